"""The published models are what their sources say: units, signs, linearisation."""

import fixed_wing
import multirotor
import numpy as np
import pytest

from helisim.ident.evaluate import state_space


def same_poles(found, expected):
    return np.sort_complex(found) == pytest.approx(np.sort_complex(expected), rel=1e-9, abs=1e-12)


def test_the_f_16_in_radians_is_the_one_in_degrees():
    """Its poles are those of the published matrix, and the published feedback does its work.

    The example designs output feedback of washed-out yaw rate, roll rate, sideslip and bank,
    in degrees, for a damped Dutch roll: with it no oscillation may be damped less than 0.5, open
    loop the Dutch roll has 0.14. A wrong sign or unit leaves it undamped or unstable.
    """
    a = np.array(
        [
            [-0.3220, 0.0640, 0.0364, -0.9917, 0.0003, 0.0008],
            [0.0, 0.0, 1.0, 0.0037, 0.0, 0.0],
            [-30.6492, 0.0, -3.6784, 0.6646, -0.7333, 0.1315],
            [8.5396, 0.0, -0.0254, -0.4764, -0.0319, -0.0620],
            [0.0, 0.0, 0.0, 0.0, -20.2, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, -20.2],
        ]
    )
    model = state_space(fixed_wing.f_16_structure(), fixed_wing.F_16)
    assert same_poles(model.poles(), np.linalg.eigvals(a))
    degrees = 180.0 / np.pi
    washed = np.zeros((7, 7))
    washed[:6, :6] = model.A
    washed[6, [3, 6]] = degrees, -1.0
    output = np.zeros((4, 7))
    output[0, [3, 6]] = degrees, -1.0
    output[1, 2] = output[2, 0] = output[3, 1] = degrees
    gain = np.array([[-0.56, -0.44, 0.11, -0.35], [-1.19, -0.21, -0.44, 0.26]])
    act = np.vstack([model.B, np.zeros((1, 2))]) / degrees
    poles = np.linalg.eigvals(washed - act @ gain @ output)
    assert np.min(-poles.real / np.abs(poles)) > 0.5


def test_the_learjet_in_metres_is_the_one_in_feet():
    """Units leave the poles alone: those of the source's matrices, in feet."""
    d, known = fixed_wing.LEARJET_FEET, (525.0, 17.0, 32.146, np.deg2rad(2.378))
    ahead, down, gravity, theta = known
    longitudinal = [
        [d["X_u"], d["X_w"], -down, -gravity * np.cos(theta)],
        [d["Z_u"], d["Z_w"], ahead, -gravity * np.sin(theta)],
        [d["M_u"], d["M_w"], d["M_q"], 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
    lateral = [
        [d["Y_v"], d["Y_p"] + down, -ahead, gravity * np.cos(theta)],
        [d["L_v"], d["L_p"], d["L_r"], 0.0],
        [d["N_v"], d["N_p"], d["N_r"], 0.0],
        [0.0, 1.0, np.tan(theta), 0.0],
    ]
    for structure, axes, matrix in (
        (fixed_wing.learjet_longitudinal_structure(), "XZM", longitudinal),
        (fixed_wing.learjet_lateral_structure(), "YLN", lateral),
    ):
        model = state_space(structure, fixed_wing.learjet(axes))
        assert same_poles(model.poles(), np.linalg.eigvals(matrix))


def test_the_quadrotor_is_the_slope_of_the_simulators_forces():
    """Forces and moments of four rotors, summed as the simulator does, differentiated.

    Rotors are at the ends of the arms (front, left, back, right; x ahead, y left, z up), each
    with its thrust, drag across and moment; the structure's derivatives are their slopes.
    """
    places = 0.17 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    arms = np.hstack([places, np.full((4, 1), 0.01)])
    turning = np.array([-1.0, 1.0, -1.0, 1.0])  # clockwise from above is negative
    flip = np.array([1.0, -1.0, -1.0])  # to ahead, right, down

    def accelerations(velocity, rates, speed):
        force, moment = np.zeros(3), np.zeros(3)
        for place, sign, omega in zip(arms, turning, speed):
            across = flip * velocity + np.cross(flip * rates, place)
            across[2] = 0.0
            push = np.array([0.0, 0.0, 8.54858e-6 * omega**2]) - 8.06428e-5 * omega * across
            force += push
            moment += np.cross(place, push) - 1e-6 * omega * across
            moment[2] -= sign * 0.016 * 8.54858e-6 * omega**2
        inertia = [multirotor.INERTIA_ROLL, multirotor.INERTIA_ROLL, multirotor.INERTIA_YAW]
        return np.concatenate([flip * force / multirotor.MASS, flip * moment / inertia])

    hover = multirotor.HOVER_SPEED
    still = accelerations(np.zeros(3), np.zeros(3), np.full(4, hover))
    assert still[2] == pytest.approx(-multirotor.GRAVITY)

    def slope(change, by):
        up = accelerations(*(x + by * y for x, y in zip(rest, change)))
        down = accelerations(*(x - by * y for x, y in zip(rest, change)))
        return (up - down) / (2.0 * by)

    rest = (np.zeros(3), np.zeros(3), np.full(4, hover))
    nothing = (np.zeros(3), np.zeros(3), np.zeros(4))
    truth = multirotor.HUMMINGBIRD
    rows = {"X": 0, "Y": 1, "Z": 2, "L": 3, "M": 4, "N": 5}
    mixer = {
        "lat": hover * np.array([0.0, 1.0, 0.0, -1.0]),
        "lon": hover * np.array([1.0, 0.0, -1.0, 0.0]),
        "ped": hover * np.array([-1.0, 1.0, -1.0, 1.0]),
        "col": hover * np.ones(4),
    }
    causes = {
        **{name: (np.eye(3)[k], *nothing[1:]) for k, name in enumerate("uvw")},
        **{name: (nothing[0], np.eye(3)[k], nothing[2]) for k, name in enumerate("pqr")},
        **{name: (*nothing[:2], speeds) for name, speeds in mixer.items()},
    }
    for name, value in truth.items():
        effect, _, cause = name.partition("_")
        if effect in rows:
            # Central differences of polynomials of degree two: exact but for rounding.
            assert slope(causes[cause], 1e-3)[rows[effect]] == pytest.approx(value, rel=1e-6)
