"""A control law as matrices: its file, what it does at its ticks, and what it refuses."""

import math

import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.linear import zero_order_hold
from helisim.design.laws.law import law_of, read_law
from helisim.design.laws.state_space import StateSpaceLaw
from helisim.design.lqg import LqgWeights, Tracked, lqg
from helisim.vehicle.law import linearize_law

INPUTS = ("p", "phi", "psi", "LAT", "COL")


def random_law(seed: int = 1, **changes) -> StateSpaceLaw:
    """A stable law of five states."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((5, 5))
    a *= 0.9 / np.max(np.abs(np.linalg.eigvals(a)))
    shapes = {"b": (5, 5), "c": (4, 5), "d": (4, 5), "windup": (5, 4), "start": (5, 4)}
    matrices = {name: 0.1 * rng.standard_normal(shape) for name, shape in shapes.items()}
    return StateSpaceLaw(**{"period": 0.002, "inputs": INPUTS, "a": a, **matrices, **changes})


def test_file_gives_back_the_same_law(tmp_path):
    """What is written is read again to the last bit."""
    law = random_law(limits=(0.5, 0.4, 0.3, 0.2), name="mine", provenance={"made_by": "hand"})
    law.write(tmp_path / "law.toml")
    again = read_law(tmp_path / "law.toml")
    assert isinstance(again, StateSpaceLaw)
    for name in ("a", "b", "c", "d", "windup", "start"):
        assert np.array_equal(getattr(again, name), getattr(law, name))
    assert again.to_dict() == law.to_dict()


def test_compiled_law_is_its_matrices_within_limits_and_cuts_off_beyond(jr700):
    """At each tick the commands are C x + D seen about the trim, and the state follows."""
    vehicle = jr700
    law = random_law()
    controller = law.on(vehicle)
    settings, trim = np.asarray(controller.settings), vehicle.trim
    call = controller.law
    rng = np.random.default_rng(2)
    state, x = np.zeros(law.order), np.zeros(law.order)
    steady = hs.Seen(*([0.0] * 18))._replace(phi=trim.phi, theta=trim.theta)
    middle = np.array([trim.col, trim.lon, trim.lat, trim.ped])
    cut = 0
    for size in (1e-3, 1e-2, 10.0, 1.0, 1e-3):
        off = dict(zip(INPUTS, size * rng.standard_normal(5)))
        seen = steady._replace(**{name: getattr(steady, name) + by for name, by in off.items()})
        y = np.array([*off.values()])
        y[2] = math.remainder(y[2], 2.0 * math.pi)  # of a heading
        front, left, right, tail = call(seen, state, settings)
        given = np.array([*vehicle.swashplate.unmix(front, left, right), tail])
        whole = middle + law.c @ x + law.d @ y
        assert given == pytest.approx(np.clip(whole, -0.5, 0.5), abs=1e-12)
        cut += bool(np.any(np.abs(whole) > 0.5))
        x = law.a @ x + law.b @ y + law.windup @ (np.clip(whole, -0.5, 0.5) - whole)
        assert state == pytest.approx(x, abs=1e-12)
    assert 0 < cut < 5


def test_restart_moves_no_servo(jr700):
    """With as many free states as commands the law starts with the commands that stand."""
    vehicle = jr700
    rng = np.random.default_rng(3)
    c, d = rng.standard_normal((4, 4)), rng.standard_normal((4, 2))
    law = StateSpaceLaw(
        period=0.002, inputs=("p", "phi"), a=np.eye(4), b=np.zeros((4, 2)), c=c, d=d,
        start=np.linalg.inv(c),
    )  # fmt: skip
    controller = law.on(vehicle)
    servos = (0.1, -0.05, 0.02, 0.15)
    seen = hs.Seen(0.0, 0.01, 0, 0, 0.05, 0, 0, 0, 0, -9.8, *servos, 0, 0, 0, 0)
    state = np.zeros(4)
    controller.law.reset(seen, state, controller.settings)
    assert controller.law(seen, state, controller.settings) == pytest.approx(servos)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inputs": ("p", "phi", "psi", "LAT", "airspeed")}, "'airspeed'.*available"),
        ({"inputs": ("p", "p", "psi", "LAT", "COL")}, "twice"),
        ({"inputs": "p"}, "inputs must be a list of names, got 'p'"),
        ({"inputs": ("p", "phi")}, r"b must be 5 by 2, got \(5, 5\)"),
        ({"a": np.full((5, 5), np.nan)}, "a must hold numbers, each finite"),
        ({"c": [["x"]]}, "c must be an array of numbers"),
        ({"a": 3.0}, "a must be a square matrix"),
        ({"period": 0.0}, "period must be a number above 0"),
        ({"limits": (0.5, 0.5)}, "limits must be a list of 4 numbers above 0"),
    ],
)
def test_what_is_no_law_says_why(changes, message):
    """Shapes, names and numbers are looked at before anything flies."""
    with pytest.raises(InputError, match=message):
        random_law(**changes)


def test_file_that_lacks_a_matrix_or_has_parameters_says_so():
    """Missing and unknown names are listed."""
    data = random_law().to_dict()
    del data["c"]
    with pytest.raises(InputError, match="needs c"):
        law_of(data)
    with pytest.raises(UnknownNameError, match="'gain'"):
        law_of({**random_law().to_dict(), "gain": 1.0})
    with pytest.raises(UnknownNameError, match=r"'lat\.gain'"):
        random_law().replace({"lat.gain": 1.0})


def test_law_flies_only_at_its_own_ticks(jr700):
    """A law that is sampled at another period is refused, with both periods."""
    law = random_law(period=0.004)
    with pytest.raises(InputError, match="each 4 ms and can't tick each 2 ms"):
        law.on(jr700)
    with pytest.raises(InputError, match="can't tick each 2 ms"):
        law.linear(0.002)


def without_speeds(vehicle: hs.Vehicle, *, period: float = 0.002):
    """The exact base helicopter without speeds and positions, sampled: for designs in tests."""
    import control

    system = vehicle.linearize("IN1").system
    speeds = ("u", "v", "w", "psi", "north", "east", "down")
    kept = [k for k, name in enumerate(system.state_labels) if name not in speeds]
    inputs, outputs = ["lon", "lat", "ped"], ["p", "q", "r", "phi", "theta"]
    columns = [system.input_labels.index(name) for name in inputs]
    rows = [system.output_labels.index(name) for name in outputs]
    a, b, c = (np.asarray(getattr(system, name)) for name in "ABC")
    a, b = zero_order_hold(a[np.ix_(kept, kept)], b[np.ix_(kept, columns)], period)
    states = [system.state_labels[k] for k in kept]
    names = {"states": states, "inputs": inputs, "outputs": outputs}
    return control.StateSpace(a, b, c[np.ix_(rows, kept)], 0.0, period, **names)


TRACKED = (
    Tracked(output="theta", stick="LON", gain=0.6, frequency=8.0),
    Tracked(output="phi", stick="LAT", gain=0.6, frequency=8.0),
    Tracked(output="r", stick="PED", gain=3.0, frequency=8.0, error=0.3),
)
WEIGHTS = LqgWeights(output={"p": 1.0, "q": 1.0})


@pytest.mark.slow
def test_lqg_on_the_jr700_is_linearised_as_it_flies(jr700):
    """The compiled law differentiated in the vehicle is its matrices; the loop is stable."""
    vehicle = jr700
    law = lqg(without_speeds(vehicle), TRACKED, WEIGHTS)
    flying = vehicle.with_controller(law.on(vehicle))
    own = law.linear(0.002)
    found = linearize_law(flying.controller, flying.model, flying.trim)
    omega = np.geomspace(0.3, 200.0, 40)
    columns = [found.input_labels.index(name) for name in own.inputs]
    seen = found(np.exp(1j * omega * 0.002))[:, columns]
    # differences of 1e-5 of numbers up to 1e2 in double precision
    assert seen == pytest.approx(own.response(omega), abs=1e-9)
    poles = np.log(flying.linearize("IN2").system.poles().astype(complex)) / 0.002
    # heading, place and the slow drift of speeds that attitudes don't stop are left
    assert np.max(poles.real) < 1e-3
