"""Draw flight records side by side as a moving picture, WebP, which browsers show by themselves.

    MUJOCO_GL=egl python scripts/pictures/movie.py RECORD [RECORD ...] OUT.webp [options]

The camera follows the helicopter; with --still it stays where it begins. Records of `helisim fly
--rotor` show how the rotor tilts.
"""

import argparse
import sys
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

import helisim as hs
from helisim.physics.layout import STATE
from helisim.physics.motion import flip
from helisim.records.record import ATTITUDES, LOAD, POSITIONS
from helisim.show.viewer import Rotors
from helisim.vehicle.addresses import addresses, own_centre, root_body

_HZ = 15.0  # pictures a second
_CLEARANCE = 0.5  # m, below a flight's lowest point where no ground was flown over


class Scene:
    """A record, its vehicle with all visible parts, and a camera on it."""

    def __init__(self, path: str, view: argparse.Namespace) -> None:
        self.record, self.still = hs.read_record(path), view.still
        said = self.record.provenance
        vehicle = hs.load(said["vehicle"], slung=said.get("slung"))
        self.ground = hs.Ground.of_record(self.record)
        self.model = vehicle.visual_model(self.ground and self.ground.put_into)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        root = root_body(self.model)
        self.joint = int(self.model.jnt_qposadr[self.model.body_jntadr[root]])
        away = own_centre(self.model, self.data) - self.data.xpos[root]
        self.centre = self.data.xmat[root].reshape(3, 3).T @ away
        self.rotors = Rotors(self.model)
        self.renderer = mujoco.Renderer(self.model, view.height, view.width)
        self.camera = mujoco.MjvCamera()
        self.camera.distance, self.camera.azimuth = view.distance, view.azimuth
        self.camera.elevation = view.elevation
        self.hangs = float(np.max(self.record[LOAD[2]])) if LOAD[2] in self.record else 0.0
        lowest = float(np.max(self.record["down"])) + self.hangs + _CLEARANCE
        self.raised = 0.0 if self.ground else lowest

    def draw(self, time: float, *, aim: bool) -> np.ndarray:
        """Return the picture at a time from the record's start, s, (height, width, 3)."""
        record, data = self.record, self.data
        here = min(int(np.searchsorted(record.time, record.time[0] + time)), len(record) - 1)
        body = Rotation.from_euler("ZYX", record.select(ATTITUDES)[here, ::-1])
        turned = Rotation.from_rotvec(flip(*body.as_rotvec()))
        north, west, up = flip(*record.select(POSITIONS)[here])
        place = np.array([north, west, up + self.raised])
        data.qpos[self.joint :][:3] = place - turned.apply(self.centre)
        data.qpos[self.joint + 3 :][:4] = turned.as_quat(scalar_first=True)
        if "a" in record:
            flapping = addresses(self.model).state + np.array([STATE.flap_a, STATE.flap_b])
            data.act[flapping] = record.select(("a", "b"))[here]
        if LOAD[0] in record:
            cable = [flip(*record.select(LOAD)[here])]
            swing = Rotation.align_vectors(cable, [[0.0, 0.0, -1.0]])[0]
            data.joint("slung/swing").qpos = swing.as_quat(scalar_first=True)
        if self.ground and self.ground.deck:
            for name, swing in self.ground.deck.swings.items():
                data.joint(f"deck_{name}").qpos[0] = swing.at(float(record.time[here]))
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_camlight(self.model, data)
        self.rotors.draw(data, time)
        if aim or not self.still:
            self.camera.lookat[:] = place - [0.0, 0.0, 0.5 * self.hangs]
        self.renderer.update_scene(data, self.camera)
        return self.renderer.render()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("records", nargs="+", metavar="RECORD")
    parser.add_argument("out", type=Path, metavar="OUT.webp")
    parser.add_argument("--from", dest="begin", type=float, default=0.0, help="s")
    parser.add_argument("--to", dest="end", type=float, default=np.inf, help="s")
    parser.add_argument("--speed", type=float, default=1.0, help="times real time")
    parser.add_argument("--distance", type=float, default=2.4, help="of the camera, m")
    parser.add_argument("--azimuth", type=float, default=-140.0, help="degrees")
    parser.add_argument("--elevation", type=float, default=-12.0, help="degrees")
    parser.add_argument("--width", type=int, default=400, help="of a record's picture")
    parser.add_argument("--height", type=int, default=260)
    parser.add_argument("--still", action="store_true")
    told = parser.parse_args()
    scenes = [Scene(path, told) for path in told.records]
    end = min(told.end, *(float(one.record.time[-1] - one.record.time[0]) for one in scenes))
    times = np.arange(told.begin, end, told.speed / _HZ)
    rows = [[one.draw(float(time), aim=not k) for one in scenes] for k, time in enumerate(times)]
    first, *rest = (Image.fromarray(np.hstack(row)) for row in rows)
    wait = round(1000.0 / _HZ)
    first.save(told.out, save_all=True, append_images=rest, duration=wait, loop=0, quality=50)
    print(f"{told.out}: {len(rows)} pictures, {told.out.stat().st_size / 1024:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
