"""The rotor near the ground: Cheeseman and Bennett's thrust, finite at any height."""

import math
from functools import cache

import mujoco
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from helisim.physics import air as ground
from helisim.physics.inflow import ground_share
from helisim.physics.layout import PARAM
from helisim.physics.native import installed
from helisim.vehicle import load
from helisim.vehicle.trim import place
from quasi_steady import inflow_and_thrust

SOLIDITY = 2 * 0.065 / (math.pi * 0.767)
SLOPE, NEVER = 6.0, 1e3


def solve(pitch, nearness, advance=0.0):
    return inflow_and_thrust(pitch, 0.0, advance, SOLIDITY, SLOPE, NEVER, nearness)


@given(pitch=st.floats(0.03, 0.25), height=st.floats(0.5, 20.0))
def test_thrust_at_equal_power_is_cheeseman_and_bennetts(pitch, height):
    """In hover T / T_inf = 1 / (1 - (R / 4z)^2) at one induced power (R&M 3021, eq. 1)."""
    nearness = (1.0 / (4.0 * height)) ** 2
    inflow, thrust = solve(pitch, nearness)
    # far from the ground CP_i = CT^1.5 / sqrt 2, so the same power lifts
    far = (math.sqrt(2.0) * thrust * inflow) ** (2.0 / 3.0)
    assert thrust / far == pytest.approx(1.0 / (1.0 - nearness), rel=1e-12)  # rounding


@pytest.mark.parametrize("height", [1.0, 1.25, 1.5, 2.0, 3.0])
def test_induced_power_near_the_ground_is_that_of_flight_tests(height):
    """At one thrust, beside Hayden's fit of many helicopters: 1 / (A + B (2R/z)^2).

    A = 0.9926, B = 0.0379 (J. S. Hayden, "The Effect of the Ground on Helicopter Hovering Power
    Required", AHS Forum 32, 1976; in Leishman's Principles, chapter 5). It is 0.97 at two radii.
    """
    inflow, thrust = solve(0.12, (1.0 / (4.0 * height)) ** 2)
    ratio = inflow / math.sqrt(0.5 * thrust)
    # a source over an image does 3.9 % less than measured at one radius, 1.6 % at 1.5
    assert ratio == pytest.approx(1.0 / (0.9926 + 0.0379 * (2.0 / height) ** 2), rel=0.04)


@given(pitch=st.floats(0.05, 0.25), height=st.floats(0.5, 4.0), advance=st.floats(0.001, 0.2))
def test_ground_effect_fades_with_speed(pitch, height, advance):
    """Forward, (R / 4z)^2 is divided by 1 + (mu / lambda_i)^2 (R&M 3021, eq. 5)."""
    nearness = (1.0 / (4.0 * height)) ** 2
    inflow, thrust = solve(pitch, nearness, advance)
    k = 1.0 - nearness / (1.0 + (advance / inflow) ** 2)
    flow = math.hypot(advance, inflow)
    # Glauert's balance with a share k^3 of the thrust
    assert 2.0 * inflow * flow == pytest.approx(k**3 * thrust, rel=1e-11)  # rounding


@given(
    nearness=st.floats(0.0, 0.4),
    induced=st.floats(-0.1, 0.1).filter(lambda x: abs(x) > 1e-3),
    advance=st.floats(0.0, 0.2),
)
def test_slope_of_the_share_is_its_derivative(nearness, induced, advance):
    """What Newton's method is told is what central differences find."""
    step = 1e-6 * abs(induced)
    after, _ = ground_share(nearness, induced + step, advance)
    before, _ = ground_share(nearness, induced - step, advance)
    _, slope = ground_share(nearness, induced, advance)
    # rounding of 1e-16 over a step of at least 1e-9; truncation is 1e-12 of the curvature
    assert (after - before) / (2.0 * step) == pytest.approx(slope, rel=1e-6, abs=1e-6)
    hover, at_rest = ground_share(nearness, induced, 0.0), ground_share(nearness, 0.0, 0.0)
    assert hover == pytest.approx(at_rest, rel=1e-14)


def rotor_at(vehicle, height):
    data = vehicle.hovering()
    data.qpos[2:7] = [height - 0.28, 1.0, 0.0, 0.0, 0.0]
    with installed():
        mujoco.mj_forward(vehicle.model, data)
    return data.sensor("rotor").data[:3]


@pytest.mark.parametrize("radii", [0.05, 0.3, 0.5, 0.8, 1.5, 6.0])
def test_the_ground_is_where_the_image_is(radii):
    """In hover 2 lambda^2 = k^3 CT, k = 1 - (R / 4z)^2 down to half a radius; bounded below it."""
    thrust, _, inflow = rotor_at(effect(), radii * 0.767)
    force = 1.225 * math.pi * 0.767**2 * (1700.0 * math.pi / 30.0 * 0.767) ** 2  # Table 1
    taken = 1.0 - (2.0 * inflow**2 * force / thrust) ** (1.0 / 3.0)
    if radii < 0.5:
        assert 0.25 < taken <= 0.4 + 1e-12
    else:
        assert taken == pytest.approx((0.25 / radii) ** 2, rel=1e-10)  # rounding


def test_thrust_is_smooth_and_finite_at_all_heights():
    """From under the ground to far above it: no jump, never falling with nearness above it."""
    heights = np.linspace(-2.0, 8.0, 251)
    thrust = np.array([rotor_at(effect(), height)[0] for height in heights])
    assert np.isfinite(thrust).all()
    above = heights > 0.0
    assert (np.diff(thrust[above]) < 1e-12).all()
    # steepest near z = R/2: d(CT)/dz < 5 T_inf / R, and 40 mm from one to the next
    assert np.abs(np.diff(thrust)).max() < 5.0 * thrust.min() / 0.767 * 0.04


# Ground effect over what a scene has: slopes, decks, their edges, and mocap bodies.

HUB = np.array([0.0, 0.0, 0.28])
RADIUS = 0.767


@given(
    x=st.floats(-1.5, 1.5), y=st.floats(-1.5, 1.5), a=st.floats(0.05, 1.5), b=st.floats(0.05, 1.5)
)
@example(x=0.0, y=0.1, a=0.8, b=0.7)  # every side cuts it, every corner is outside
def test_share_of_a_disc_over_a_rectangle(x, y, a, b):
    """The overlap's area is the integral of its width, found by quadrature."""

    def width(s):
        half = math.sqrt(max(0.0, 1.0 - (s - x) ** 2))
        return max(0.0, min(b, y + half) - max(-b, y - half))

    low, high = max(-a, x - 1.0), min(a, x + 1.0)
    area = 0.0
    if low < high:
        kinks = [
            x + sign * math.sqrt(1.0 - (e - y) ** 2)
            for e in (-b, b)
            for sign in (-1, 1)
            if abs(e - y) < 1.0
        ]
        inside = [k for k in kinks if low < k < high]
        area = quad(width, low, high, points=inside or None, limit=200)[0]
    # of the quadrature, at the square roots of the disc's sides
    assert ground.disc_share(x, y, a, b) == pytest.approx(area / math.pi, abs=1e-6)


@cache
def effect():
    return load(parameters={"air.ground_effect": 1.0})


def scene(*bodies, fixed=()):
    def around(spec, vehicle):
        for k, (mocap, position, quaternion, size) in enumerate(bodies):
            body = spec.worldbody.add_body(name=f"deck{k}", pos=position, quat=quaternion)
            body.mocap = mocap
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, mass=0.0)
        for position, quaternion in fixed:
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], pos=position, quat=quaternion
            )

    return effect().grounded_model(around)


def turn(axis, angle):
    return [math.cos(angle / 2), *(math.sin(angle / 2) * np.array(axis))]


def inflow(model, position=(0.0, 0.0, 0.0), quaternion=(1.0, 0.0, 0.0, 0.0), moved=None):
    data = mujoco.MjData(model)
    place(model, data, effect().trim)
    data.qpos[:7] = [*position, *quaternion]
    if moved is not None:
        data.mocap_pos[0] = moved
    with installed():
        mujoco.mj_forward(model, data)
    return data.sensor("rotor").data[2]


@pytest.fixture(scope="module")
def level():
    model = scene(fixed=[((0, 0, 0), (1, 0, 0, 0))])
    return lambda height: inflow(model, (0.0, 0.0, height - HUB[2]))


def equivalent(shaft, hub, point, normal):
    """Return the height over level ground at which the image pushes as much along the shaft.

    A source in the hub and its mirror image in the plane, by vectors (Cheeseman and Bennett's
    method, R&M 3021, section 2): the image's velocity at the hub is Q / (4 pi d^2) away from it.
    """
    hub, normal = np.array(hub), np.array(normal)
    image = hub - 2.0 * ((hub - point) @ normal) * normal
    apart = hub - image
    distance = np.linalg.norm(apart)
    along = (apart / distance) @ shaft / distance**2
    return 0.5 / math.sqrt(along)


def test_a_leaning_shaft_sees_less_of_level_ground(level):
    model = scene(fixed=[((0, 0, 0), (1, 0, 0, 0))])
    shaft = [0.0, math.sin(0.4), math.cos(0.4)]
    origin = np.array([0.0, 0.0, 1.0]) - HUB[2] * np.array(shaft)
    leaning = inflow(model, origin, turn([1, 0, 0], -0.4))
    expected = level(equivalent(shaft, [0, 0, 1.0], np.zeros(3), [0, 0, 1]))
    assert leaning == pytest.approx(expected, rel=1e-12)
    over = inflow(model, (0.0, 0.0, 1.0 + HUB[2]), turn([1, 0, 0], math.pi))
    assert over == pytest.approx(level(1e6), rel=1e-12)


def test_a_deck_is_ground_where_it_is(level):
    model = scene((True, [0, 0, 1.75], [1, 0, 0, 0], [5.0, 5.0, 0.25]))
    assert inflow(model, (0, 0, 3.0 - HUB[2])) == pytest.approx(level(1.0), rel=1e-12)
    raised = inflow(model, (0, 0, 3.0 - HUB[2]), moved=[1.0, 0.0, 2.05])
    assert raised == pytest.approx(level(0.7), rel=1e-12)


def test_over_an_edge_there_is_as_much_ground_as_deck(level):
    """Half of the disc over the edge: half of (R / 4z)^2, the rest of it that of what is below."""
    deck = (False, [0, 0, 19.75], [1, 0, 0, 0], [5.0, 5.0, 0.25])
    alone = scene(deck)
    assert inflow(alone, (5.8, 0.0, 21.0 - HUB[2])) == pytest.approx(level(1e6), rel=1e-12)
    assert inflow(alone, (0.0, 0.0, 19.4)) == pytest.approx(level(1e6), rel=1e-12)  # below it
    half = RADIUS**2 / 16.0 * (0.5 / 1.0 + 0.5 / 3.0**2)
    above_ground = scene(deck, fixed=[((0, 0, 18.0), (1, 0, 0, 0))])
    assert inflow(above_ground, (5.0, 0.0, 21.0 - HUB[2])) == pytest.approx(
        level(RADIUS / (4.0 * math.sqrt(half))), rel=1e-12
    )


def test_boxes_side_by_side_are_one_deck(level):
    tiles = [
        (False, [x, y, -0.25], [1, 0, 0, 0], [1.0, 1.0, 0.25]) for x in (-1, 1) for y in (-1, 1)
    ]
    at = (0.2, 0.1, 1.0 - HUB[2])
    assert inflow(scene(*tiles), at) == pytest.approx(level(1.0), rel=1e-9)
    below = [(False, [0, 0, -1.0 - k], [1, 0, 0, 0], [3.0, 3.0, 0.25]) for k in range(4)]
    assert inflow(scene(*below, *tiles), at) == pytest.approx(level(1.0), rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_box_of_any_attitude_is_its_upper_face(level, seed):
    """By vectors: where the disc's points come down on it along its normal, 30 000 of them."""
    rng = np.random.default_rng(seed)
    size, turned = rng.uniform(0.2, 0.9, 3), Rotation.random(rng=rng)
    model = scene((False, [0.0, 0.0, 20.0], turned.as_quat(scalar_first=True), size))
    axes = turned.as_matrix()
    up = np.argmax(np.abs(axes[2]))
    normal, height = axes[:, up] * np.sign(axes[2, up]), rng.uniform(0.5, 1.0)
    sides = [k for k in range(3) if k != up]
    middle = np.zeros(3)
    middle[sides] = rng.uniform(-0.6, 0.6, 2)
    hub = np.array([0.0, 0.0, 20.0]) + (size[up] + height) * normal + axes @ middle
    radius, angle = np.sqrt((np.arange(100) + 0.5) / 100), np.arange(300) * np.pi / 150.0
    spot = RADIUS * radius[:, None] * np.cos(angle), RADIUS * radius[:, None] * np.sin(angle)
    over = np.abs(middle[sides[0]] + spot[0]) < size[sides[0]]
    share = np.mean(over & (np.abs(middle[sides[1]] + spot[1]) < size[sides[1]]))
    near = share * normal[2] * (RADIUS / (4.0 * height)) ** 2
    found, far = inflow(model, hub - HUB), level(1e6)
    # half of the share of points that a side may pass by
    assert far - found == pytest.approx(far - level(RADIUS / (4.0 * math.sqrt(near))), rel=0.01)


@given(surfaces=st.lists(st.floats(0.01, 0.4), max_size=9))
def test_the_four_nearest_surfaces_are_kept_in_order(surfaces):
    near, count = [0.0] * 8, 0
    for one in surfaces:
        count = ground._insert(near, count, one, 2.0 * one)
    kept = sorted(surfaces, reverse=True)[:4]
    assert near[: 2 * count] == [number for one in kept for number in (one, 2.0 * one)]


def test_what_nothing_can_touch_is_no_ground():
    def drawn(spec, vehicle):
        plane = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0, 0, 1]}
        spec.worldbody.add_geom(pos=[0, 0, 0.9], contype=0, conaffinity=0, group=1, **plane)
        spec.worldbody.add_geom(pos=[0, 0, 5.0], quat=[0, 1, 0, 0], **plane)
        spec.worldbody.add_geom(pos=[0, 0, 0.2], contype=1, conaffinity=0, **plane)
        body = spec.body("jr700")
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.1] * 3,
            pos=[0, 0, -0.5],
            conaffinity=1,
            mass=0.0,
        )

    vehicle = effect()
    model = vehicle.grounded_model(drawn)
    # without any surface the ground is at height 0
    expected = inflow(vehicle.model, (0, 0, 0.8))
    assert inflow(model, (0, 0, 1.0)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_the_hub_of_a_leaning_shaft_is_where_the_axes_say(level, lean):
    """Shaft upright, the body leans back: its hub stands over a deck's edge at its own height."""
    deck = (False, [0, 0, 19.75], [1, 0, 0, 0], [5.0, 5.0, 0.25])
    model = scene(deck)
    par = model.actuator_user[model.actuator("rotor").id]
    par[[PARAM.shaft_cosine, PARAM.shaft_sine, PARAM.hub_x]] = math.cos(lean), math.sin(lean), 0.2
    hub = np.array([5.0, 0.0, 21.0])
    found = inflow(model, hub - HUB - [0.2, 0.0, 0.0], turn([0, 1, 0], -lean))
    assert found == pytest.approx(level(math.sqrt(2.0)), rel=1e-12)  # half of the disc


@pytest.mark.parametrize("height", [0.4, 1.0, 5.0])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_wash_is_stopped_by_the_ground(par, height, share):
    """Between hub and ground the mirrored source, by vectors, takes away so much of the wash."""
    place, hub = np.array([0.0, 0.0, share * height]), np.array([0.0, 0.0, height])
    own, image = ((place - at) / np.linalg.norm(place - at) ** 3 for at in (hub, [1, 1, -1] * hub))
    nearness = (par[PARAM.main_radius] / (4.0 * height)) ** 2
    left = ground.wash_residual(par, nearness, par[PARAM.hub_z] + (1.0 - share) * height)
    assert left == pytest.approx((own + image)[2] / own[2], abs=1e-12)
    assert ground.wash_residual(par, nearness, par[PARAM.hub_z] + 1.4 * height) == 0.0  # below it
