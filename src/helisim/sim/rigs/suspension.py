"""The suspension from rig to finding: the centre of gravity and the IMU's lever arm."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.motion import flip
from helisim.sim.recorder import Recorder
from helisim.sim.rigs.finding import Finding, RigTest
from helisim.sim.rigs.hold import hang, hold, suspension_points
from helisim.sim.rigs.plumb import REST, PlumbLine, centre_of_gravity, plumb_line
from helisim.sim.trajectory import imu_offset
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import root_body

_MILLIMETRE = 1e-3


def suspension_test(
    vehicle: Vehicle, *, seed: int = 1, recorder: Recorder | None = None
) -> RigTest:
    """Find the centre of gravity and the IMU's lever arm: hang the helicopter from two points."""
    held = hold(vehicle, "suspension")
    recorder = recorder or Recorder.of(vehicle)
    points = suspension_points(held)
    records = {name: hang(held, name, seed=seed, recorder=recorder) for name in points}
    lines = [plumb_line(records[name], point) for name, point in points.items()]
    found = centre_of_gravity(lines)
    true_centre, imu = _drawing(held)
    arm, true_arm = imu - found, imu_offset(held)
    first, second = (np.array(line.down) for line in lines)
    crossing = float(np.arccos(np.clip(first @ second, -1.0, 1.0)))
    gap = abs(np.cross(first, second) @ (lines[1].point - lines[0].point)) / np.sin(crossing)
    sensitivity = attitude_sensitivity(lines)
    worst = max(recorder.noise.get("phi", 0.0), recorder.noise.get("theta", 0.0))
    samples = recorder.rate_hz * REST
    allowed = _MILLIMETRE / sensitivity
    findings = [
        Finding(
            name=f"{name}_{axis}",
            unit="m",
            value=float(value),
            truth=float(true),
            standard_error=float(error),
            how=how,
        )
        for name, values, truths, how in (
            ("cg", found, true_centre, "where the plumb lines meet, airframe axes"),
            ("imu", arm, true_arm, "lever arm: the drawing's IMU less the centre of gravity"),
        )
        for axis, value, true, error in zip("xyz", values, truths, _errors(lines))
    ]
    findings.append(
        Finding(
            name="cg distance",
            unit="m",
            value=float(np.linalg.norm(found - true_centre)),
            truth=0.0,
            how="found to true centre of gravity",
        )
    )
    return RigTest(
        rig="suspension",
        findings=tuple(findings),
        notes=(
            f"the lines cross at {np.degrees(crossing):.1f} degrees and miss each other by "
            f"{1e3 * gap:.3f} mm",
            f"an attitude off by 1 mrad in the worst way moves the centre by "
            f"{sensitivity:.3f} mm: 1 mm allows a bias of {1e3 * allowed:.2f} mrad "
            f"({np.degrees(allowed):.2f} degrees), or {1e3 * allowed * np.sqrt(samples):.0f} mrad "
            f"of white noise averaged over {REST:g} s; the recorder has {1e3 * worst:.3g} mrad",
        ),
    )


def attitude_sensitivity(lines: Sequence[PlumbLine]) -> float:
    """Return how far the centre moves for the worst attitude error of given size, m/rad.

    All of phi and theta of all hangings are off by that size, with the worst signs.
    """
    shifts = _shifts(lines).reshape(-1, 3)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * len(shifts))).reshape(len(shifts), -1)
    return float(np.linalg.norm(signs.T @ shifts, axis=1).max())


def _errors(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    """Return the standard error of the centre of gravity along each axis, (3,) m."""
    error = np.array([line.error for line in lines])
    return np.sqrt(np.sum((_shifts(lines) * error[:, None, None]) ** 2, axis=(0, 1)))


def _shifts(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    """Return how the centre moves as a line tilts, (n_line, 2 ways across, 3) m/rad."""
    centre = centre_of_gravity(lines)
    shifts = np.empty((len(lines), 2, 3))
    for number, line in enumerate(lines):
        down = np.array(line.down)
        for k, direction in enumerate(np.linalg.svd(down[None, :])[2][1:]):
            tilted = down + 1e-6 * direction
            moved = list(lines)
            moved[number] = PlumbLine(line.point, tilted / np.linalg.norm(tilted))
            shifts[number, k] = (centre_of_gravity(moved) - centre) / 1e-6
    return shifts


def _drawing(held: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return true centre of gravity and IMU in the airframe's own axes (FRD), (3,) m each."""
    model = held.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    body = root_body(model)
    turned = data.xmat[body].reshape(3, 3).T
    centre = turned @ (data.subtree_com[body] - data.xpos[body])
    imu = turned @ (data.site(held.roles.site("imu")).xpos - data.xpos[body])
    return np.array(flip(*centre)), np.array(flip(*imu))
