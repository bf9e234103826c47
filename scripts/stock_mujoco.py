"""Fly a shipped MJCF, and three of them in one scene, in MuJoCo without helisim's loader.

MuJoCo's own loader, keyframe and mj_step; of helisim only the block that lends it the force laws.

    python scripts/stock_mujoco.py [VEHICLE]
"""

import sys

import mujoco
import numpy as np

import helisim as hs


def one(folder) -> None:
    """Hover for ten seconds, then roll with the lateral stick."""
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    start = data.qpos[:3].copy()
    with hs.installed():
        while data.time < 10.0:
            mujoco.mj_step(model, data)
        print(f"{folder.name}: {np.abs(data.qpos[:3] - start).max():.1e} m off after 10 s of hover")
        data.actuator("LAT").ctrl = 0.05
        while data.time < 10.5:
            mujoco.mj_step(model, data)
    print(f"LAT 0.05 for half a second: it rolls with {data.sensor('imu_gyro').data[0]:.2f} rad/s")


def three(folder) -> None:
    """Attach three to one scene, each with a prefix, and lift the second."""
    world = mujoco.MjSpec.from_string(
        '<mujoco model="three"><option integrator="RK4" timestep="0.002" gravity="0 0 -9.8015"/>'
        '<worldbody><geom type="plane" size="50 50 1"/></worldbody></mujoco>'
    )
    for name in ("a/", "b/", "c/"):
        vehicle = mujoco.MjSpec.from_file(str(folder / f"{folder.name}.xml"))
        vehicle.option.gravity = world.option.gravity
        world.attach(vehicle, prefix=name, frame=world.worldbody.add_frame())
    model = world.compile()
    print("helicopters in the scene:", ", ".join(hs.check_model(model)))
    data = mujoco.MjData(model)
    for k, name in enumerate(("a/", "b/", "c/")):
        key = model.key(f"{name}hover")  # of this vehicle; the others are as at the start
        data.qpos += key.qpos - model.qpos0
        data.act += key.act
        data.ctrl += key.ctrl
        data.joint(f"{name}root").qpos[1] += 3.0 * k
    data.actuator("b/COL").ctrl += 0.1
    with hs.installed():
        while data.time < 1.0:
            mujoco.mj_step(model, data)
    climbed = [data.joint(f"{name}root").qpos[2] - 10.0 for name in ("a/", "b/", "c/")]
    print("climbed, m:", ", ".join(f"{height:.2f}" for height in climbed))


def main(vehicle: str = "jr700") -> None:
    """Fly one, then three."""
    folder = hs.model_folder(vehicle)
    one(folder)
    three(folder)


if __name__ == "__main__":
    main(*sys.argv[1:])
