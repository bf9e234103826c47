"""LQG laws: printed and closed-form gains, separation, following, and what can't be stabilised."""

from dataclasses import replace

import control
import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.design.lqg import LqgWeights, Tracked, lqg, regulator
from helisim.records.record import IN2

PERIOD = 0.01


def sampled(a, b, c, states, outputs, inputs="lat", period=PERIOD) -> LinearSystem:
    """A continuous model, its commands held each period."""
    names = inputs.split(), outputs.split(), states.split()
    d = np.zeros((len(c), len(names[0])))
    return LinearSystem(a, b, c, d, None, *names).discretise(period)


def pendulum() -> LinearSystem:
    cart, mass, friction, inertia, g, length = 0.5, 0.2, 0.1, 0.006, 9.8, 0.3
    p = inertia * (cart + mass) + cart * mass * length**2
    turned = inertia + mass * length**2
    a = [
        [0, 1, 0, 0],
        [0, -turned * friction / p, mass**2 * g * length**2 / p, 0],
        [0, 0, 0, 1],
        [0, -mass * length * friction / p, mass * g * length * (cart + mass) / p, 0],
    ]
    b = [[0], [turned / p], [0], [mass * length / p]]
    return sampled(a, b, [[1, 0, 0, 0], [0, 0, 1, 0]], "x v s r", "v phi")


def turning(*, delay: int = 0, period: float = PERIOD) -> LinearSystem:
    """Roll by lateral cyclic: a lag of 0.05 s, then two integrals, behind whole ticks of delay."""
    a, b = [[0, 1, 0], [0, 0, 40.0], [0, 0, -20.0]], [[0], [0], [20.0]]
    now = sampled(a, b, np.eye(2, 3), "phi p flap", "phi p", period=period)
    return replace(now, delays={"lat": delay * period}).with_delays_as_states()


ROLL = Tracked(output="phi", stick="LAT", gain=0.6, frequency=6.0)


@pytest.mark.parametrize(
    ("position", "angle", "printed"),
    [
        # Control Tutorials for MATLAB and Simulink (University of Michigan, Carnegie Mellon,
        # Detroit Mercy), "Inverted Pendulum: Digital Controller Design", printed K of both designs
        (1.0, 1.0, (-0.9384, -1.5656, 18.0351, 3.3368)),
        (5000.0, 100.0, (-61.9933, -33.5040, 95.0597, 18.8300)),
    ],
)
def test_regulator_gains_are_those_a_tutorial_prints(position, angle, printed):
    weights = LqgWeights(output={"v": position**-0.5, "phi": angle**-0.5}, effort={"lat": 1.0})
    found = regulator(pendulum(), (), weights)
    assert found.gain[0] == pytest.approx(printed, abs=6e-5)  # printed to four decimals


NOISY = {"disturbance": {"lat": 9.0}, "noise": {"phi": 0.001}}


@pytest.mark.parametrize(
    ("output", "given", "ratio"), [("phi", NOISY, 9000.0), ("phi", {}, 2.0), ("p", {}, 1.0)]
)
def test_filter_is_the_alpha_beta_filter(output, given, ratio):
    """Of a position measured under random acceleration the filter's gains have a closed form.

    P. Kalata, "The tracking index", IEEE Transactions on Aerospace and Electronic Systems 20,
    1984: with the index L = T^2 s_w / s_v, r = (4 + L - sqrt(8 L + L^2)) / 4, alpha = 1 - r^2 and
    beta = 2 (2 - alpha) - 4 sqrt(1 - alpha).
    """
    moved = sampled([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], "x v", output)
    weights, index = LqgWeights(output={output: 1.0}, **given), PERIOD**2 * ratio
    r = (4.0 + index - np.sqrt(8.0 * index + index**2)) / 4.0
    alpha = 1.0 - r**2
    beta = 2.0 * (2.0 - alpha) - 4.0 * np.sqrt(1.0 - alpha)
    gains = regulator(moved, (), weights).filter_gain[:, 0]
    assert gains == pytest.approx([alpha, beta / PERIOD], rel=1e-6)  # rounding of the solver


@pytest.mark.parametrize("changes", [{}, {"error": 0.2, "settle": 2.0}])
def test_error_integral_and_effort_weigh_by_their_squares(changes):
    """Of a G = b T / (z - 1) the poles are the stable roots of the symmetric root locus.

    Franklin, Powell and Workman, section 9.4: 1 + (e / error)^2 (1 + (T / settle)^2 / v) G G' = 0
    with v = (z - 1) (1 / z - 1) and G G' = (b T)^2 / v; 0.1 rad, 0.5 s and an effort e of 0.1.
    """
    model = sampled([[0.0]], [[800.0]], [[1.0]], "phi", "phi")
    own = {"error": 0.1, "settle": 0.5} | changes
    z = regulator(model, (replace(ROLL, **changes),), LqgWeights()).poles[0]
    one = (800.0 * PERIOD * 0.1 / own["error"]) ** 2
    wanted = np.roots([1.0, one, one * (PERIOD / own["settle"]) ** 2])
    np.testing.assert_allclose(np.sort((z - 1.0) * (1.0 / z - 1.0)), np.sort(wanted), rtol=1e-9)


def closed(model, law) -> np.ndarray:
    """The closed loop's matrix, put together from the model's and the law's."""
    a, b, c = model.a, model.b, model.c
    rows = [["col", "lon", "lat", "ped"].index(name) for name in model.inputs]
    seen = slice(len(c))
    gain, shown = law.c[rows], law.d[rows, seen]
    return np.block([[a + b @ shown @ c, b @ gain], [law.b[:, seen] @ c, law.a]])


@pytest.mark.parametrize("delay", [0, 4])
def test_closed_loop_has_the_poles_of_regulator_filter_and_commands(delay):
    """Separation: nothing but the poles of the three parts, with delays among the states."""
    model = turning(delay=delay)
    found, law = regulator(model, (ROLL,), LqgWeights()), lqg(model, (ROLL,))
    parts = [*found.poles, np.full(2, np.exp(-6.0 * PERIOD))]
    wanted = np.poly(np.concatenate(parts))
    # coefficients, as the double pole of the command model is no smooth function of the matrix
    assert np.poly(closed(model, law)) == pytest.approx(wanted, abs=1e-9)


def test_model_follows_a_step_as_the_command_model_does():
    """A step of the stick gives 1 - (1 + w t) exp(-w t) of what it asks for, at the ticks."""
    model = sampled([[0, 1], [0, 0]], [[0], [800.0]], np.eye(2), "phi p", "phi p")
    w, stick, steps = 6.0, 0.5, 150
    law = lqg(model, (ROLL,))
    roll = flown(model, law, np.full(steps, stick))
    time = PERIOD * np.arange(steps)
    wanted = 0.6 * stick * (1.0 - (1.0 + w * time) * np.exp(-w * time))
    # the command is held over a tick, the wanted acceleration isn't: half of w T off at first
    assert np.max(np.abs(roll - wanted)) < 0.02 * 0.6 * stick
    assert roll[-1] == pytest.approx(wanted[-1], rel=1e-3)
    passed = [law.d[k, law.inputs.index(IN2[k])] for k in (0, 1, 3)]  # a command that it lacks
    assert passed == [1.0, 1.0, 1.0]


def flown(model, law, sticks, *, limit=np.inf, windup=None) -> np.ndarray:
    """The first output over ticks, the law's one command at work behind its limit."""
    a, b, c = model.a, model.b, model.c
    x, z, out = np.zeros(len(a)), np.zeros(len(law.a)), []
    windup = law.windup if windup is None else windup
    for stick in sticks:
        seen = np.zeros(len(law.inputs))
        seen[: len(c)], seen[law.inputs.index("LAT")] = c @ x, stick
        out.append((c @ x)[0])
        whole = law.c @ z + law.d @ seen
        given = np.clip(whole, -limit, limit)
        x = a @ x + b[:, 0] * given[2]
        z = law.a @ z + law.b @ seen + windup @ (given - whole)
    return np.array(out)


def test_law_that_stood_at_its_limit_comes_back_at_once():
    """A rate beyond what the limit gives is asked for, then none: the integral lets go at once."""
    model = sampled([[-2.0]], [[10.0]], [[1.0]], "p", "p")
    law = lqg(model, (Tracked(output="p", stick="LAT", gain=1.0, frequency=8.0),))
    sticks = np.where(np.arange(400) < 200, 1.0, 0.0)
    kept = flown(model, law, sticks, limit=0.1)
    wound = flown(model, law, sticks, limit=0.1, windup=np.zeros_like(law.windup))
    # at the limit p falls from 0.5 to 0.1 in ln((0.5 + 0.5) / (0.1 + 0.5)) / 2 s, and no faster
    fastest = np.log(1.0 / 0.6) / 2.0
    assert kept[199] == pytest.approx(0.5, rel=0.03)  # 10 * 0.1 / 2; it lets go a little too much
    assert fastest - PERIOD < PERIOD * np.argmax(kept[200:] < 0.1) < 1.1 * fastest
    assert np.all(wound[200 : 200 + round(2.0 * fastest / PERIOD)] > 0.1)


RATE = {"gain": 1.0, "frequency": 5.0}
TOO_FAR = "the sizes are too far apart"
UNSTABLE = [[0.5, 0], [0, -1]], "drift p"


@pytest.mark.parametrize(
    ("model", "tracked"),
    [
        (  # an unstable mode out of reach
            (UNSTABLE[0], [[0], [1]], np.eye(2), UNSTABLE[1], "phi p"),
            (Tracked(output="p", stick="LAT", **RATE),),
        ),
        ((UNSTABLE[0], [[1], [1]], [[0, 1]], UNSTABLE[1], "p"), ()),  # one that isn't sensed
        (  # the integral of a rate whose integral is a state besides can't be held too
            ([[0, 1], [0, -1]], [[0], [1]], np.eye(2), "psi r", "psi r", "ped"),
            (Tracked(output="r", stick="PED", **RATE),),
        ),
    ],
)
def test_what_can_not_be_stabilised_is_said(model, tracked):
    with pytest.raises(InputError, match="that doesn't decay isn't moved or isn't shown"):
        regulator(sampled(*model), tracked, LqgWeights())


@pytest.mark.parametrize(
    ("tracked", "weights", "message"),
    [
        ((), LqgWeights(), "0 outputs are tracked"),
        ((Tracked(output="q", stick="LON", **RATE),), LqgWeights(), "'q'.*phi, p"),
        ((ROLL, Tracked(output="p", stick="LON", **RATE)), LqgWeights(), "2 outputs"),
        ((ROLL,), LqgWeights(effort={"ped": 0.1}), "unknown effort 'ped'"),
        # sizes of which rounding would make an unstable law
        ((ROLL,), LqgWeights(effort={"lat": 1e-12}), TOO_FAR),
        ((ROLL,), LqgWeights(disturbance={"lat": 1e9}, noise={"phi": 1e-9, "p": 1e-9}), TOO_FAR),
        ((ROLL,), LqgWeights(noise={"phi": 1e12, "p": 1e12}), TOO_FAR),
    ],
)
def test_wrong_input_says_what_would_do(tracked, weights, message):
    with pytest.raises(InputError, match=message):
        lqg(turning(delay=3), tracked, weights)


def test_a_model_that_blocks_what_it_should_follow_is_said_so():
    """Its zero is the command model's pole, so no command gives that output but one without end."""
    zero, poles = np.exp(-5.0 * PERIOD), np.array([0.9, 0.5])
    c = [[zero - poles[0], poles[1] - zero]]  # of c0 / (z - 0.9) + c1 / (z - 0.5)
    model = LinearSystem(np.diag(poles), [[1], [1]], c, [[0]], PERIOD, ("lat",), ("p",))
    with pytest.raises(InputError, match=r"follow commands of 1 outputs with its 1 commands"):
        lqg(model, (Tracked(output="p", stick="LAT", **RATE),))


@pytest.mark.parametrize("what", ["output", "effort", "disturbance", "noise"])
def test_a_size_is_above_0(what):
    with pytest.raises(InputError, match="phi must be a number above 0"):
        LqgWeights(**{what: {"phi": 0.0}})


def test_model_must_be_sampled_and_late_by_a_tick():
    model = turning()
    for given, message in (
        (control.StateSpace(model.a, model.b, model.c, 0.0), "sampled at the gyro's period"),
        ("model.toml", "among its states; got str with dt = 0"),
        (replace(model, d=[[0], [1]]), "follows a command within the tick"),
        (replace(model, inputs=("aileron",)), "unknown command of the model 'aileron'"),
        (replace(model, inputs=("aileron",)).system, "unknown command of the model 'aileron'"),
    ):
        with pytest.raises(InputError, match=message):
            lqg(given, (ROLL,))
