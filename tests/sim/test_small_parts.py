"""Parts of the simulation by themselves, by hand: ways, pilots, steps, rigs, limits, settings."""

import inspect
import math
from dataclasses import fields, is_dataclass, replace
from importlib import import_module
from pkgutil import walk_packages
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from test_missions import grounded

import helisim as hs
from helisim import sim
from helisim.base.settings import limits_of
from helisim.physics.layout import HANDS_OFF_ROTOR, PARAM, ROLL_ATTITUDE, ROLL_VELOCITY
from helisim.records.record import CHANNELS, FlightRecord
from helisim.sim import flight, recorder, rigs  # noqa: F401  (rows name them)
from helisim.sim.ground import Ground, outline
from helisim.sim.limits import Contact, at_limits
from helisim.sim.missions import autopilot, mission, shipped
from helisim.sim.plan import FlightPlan, hover_height
from helisim.vehicle.addresses import addresses
from helisim.vehicle.law import trimmed_sticks
from helisim.vehicle.trim import Motion
from tabled import tabled


@pytest.mark.parametrize("name", [one.name for one in walk_packages(sim.__path__, "helisim.sim.")])
def test_what_is_left_out_and_what_can_be_asked_is_as_reviewed(name, kept):
    """Defaults of functions and settings, and the settings' limits: what a user relies upon."""
    every = vars(import_module(name)).values()
    own = [one for one in every if callable(one) and getattr(one, "__module__", "") == name]
    asked = [(one, each) for one in own for each in inspect.signature(one).parameters.values()]
    plain = int | float | str | tuple | None
    left_out = {f"{one.__name__}.{each.name}": each.default for one, each in asked
                if isinstance(each.default, plain)}  # fmt: skip
    limits = {f"{one.__name__}.{each.name}": str(replace(limits_of(each), choices=None))
              for one in own if is_dataclass(one) for each in fields(one)}  # fmt: skip
    kept([left_out, limits])


def sight(**seen):
    now = {"clearance": 2.0, "down_rate": 0.0, "north_rate": 0.0, "east_rate": 0.0}
    told = now | {"time": 0.0, "motion": Motion(), "touches": False, "rotor_speed": 1.0} | seen
    return autopilot.Sight(**told)


def ways(way, *times):
    return [[round(one, 6) for one in way[1](time)] for time in (*times, way[0] + times[-1])]


def flares(carried=0.2, **seen):
    """Return north rate and acceleration, tilt and collective that a flare wants."""
    wanted = autopilot.Wanted()
    pilot = SimpleNamespace(seen=sight(**seen), wanted=wanted, loop=SimpleNamespace(gravity=9.8),
                            carrying_collective=lambda push: carried + push)  # fmt: skip
    shipped.Autorotation()._flare(pilot)
    found = wanted.north_rate, wanted.north_acceleration, wanted.tilt, wanted.collective
    return [round(one, 6) for one in found]


def asked(script, *seen, collective=-0.4, **wants):
    """Return collective and sinking that a script wants as it sees one after the other."""
    pilot, found = grounded(0.1), []
    pilot.loop, pilot.seen = SimpleNamespace(collective=collective), seen[0]
    vars(pilot.wanted).update(wants)
    for _, now in zip(script(pilot), (*seen[1:], *[seen[-1]] * 200)):
        wanted = pilot.wanted.collective, pilot.wanted.down_rate
        found.append([None if one is None else round(one, 6) for one in wanted])
        pilot.seen = now
    return found


def stepped(*commands, count=5, **options):
    """Return the numbers of steps, times of calls, and userdata at each step."""
    model = mujoco.MjModel.from_xml_string("<mujoco><size nuserdata='2'/></mujoco>")
    data, called = mujoco.MjData(model), []
    calls = [(every, lambda data: called.append(round(data.time, 6))) for every in commands]
    rows = [(number, *data.userdata) for number in
            flight.steps(model, data, *calls, count=count, **options)]  # fmt: skip
    return [one[0] for one in rows], called, [one[1] for one in rows], round(data.time, 6)


def hung(phi=0.1, theta=-0.2, swing=0.0, drift=0.0):
    """Return a record of 20 s at rest for the last 10, with a square wave and a drift in phi."""
    time = np.arange(2001) / 100.0
    moved = swing * np.sign(np.sin(4.0 * np.pi * (time - 1e-6)))
    moved += np.where(time < 9.99, 1.0, drift * (time > 15.0))
    columns = np.column_stack([phi + moved, theta + 0.0 * time])
    return FlightRecord(time, columns, (CHANNELS["phi"], CHANNELS["theta"]), {})


CROSSING = [rigs.PlumbLine(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])),
            rigs.PlumbLine(np.array([-2.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))]  # fmt: skip


def rounded(numbers, digits=6):
    return (np.round(np.asarray(numbers, float), digits) + 0.0).tolist()


@tabled("made", "wanted")
def test_parts_by_hand(made, wanted):
    assert made() == wanted


@pytest.mark.parametrize(
    ("made", "start", "ends"), [("stick_sweep", 1.0, 59.0), ("table", 3.0, 63.0)]
)
def test_a_rigs_sweep_rises_exponentially_in_its_band(made, start, ends):
    """W = w_min + (w_max - w_min) (exp(4 t / T) - 1) / (exp(4) - 1), by quadrature."""
    low, high = (8.0, 200.0) if made == "stick_sweep" else (2.0, 120.0)

    def rate(time):
        return low + (high - low) * math.expm1(4.0 * time / (ends - start)) / math.expm1(4.0)

    for since in (0.25, 7.0, 31.3):
        time = start + since + 1e-5 * np.arange(-1, 2)
        phase, grown = quad(rate, 0.0, since)[0], min(1.0, since / (1.0 if start == 1.0 else 2.0))
        if made == "stick_sweep":
            found, wanted = rigs.stick_sweep(time)[1], 0.018 * grown * math.sin(phase)
        else:  # the rate of an angle of 0.015 rad, to the left, which grows for two seconds
            found = rigs.table_sweep(time)[1]
            wanted = -0.015 * (grown * rate(since) * math.cos(phase))
            wanted -= 0.015 * (0.5 * math.sin(phase) if since < 2.0 else 0.0)
        assert found == pytest.approx(wanted, abs=1e-6)  # (120 rad/s 10 us)^2 / 6 of 1.8 rad/s
    still = rigs.stick_sweep if made == "stick_sweep" else rigs.table_sweep
    assert not still(np.array([0.0, 0.5 * start, ends + 0.1, ends + 0.9])).any()


def test_a_thrust_takes_the_collective_of_momentum_and_blade_element(jr700):
    """V = T / (2 rho A V) with V the flow through the disc, and pitch 3 (2 C_T / (s a) + ...)."""
    model, own = jr700.model, jr700.parameters
    loop = autopilot.OuterLoop(jr700, model, jr700.trim, addresses(model).rotor)
    hover, *_ = trimmed_sticks(jr700.controller, model, jr700.trim)
    assert loop.lifting(0.0, 1.0, 0.0, 0.0) == pytest.approx(hover, abs=1e-12)
    par = model.actuator_user[addresses(model).rotor]
    area = own["air.density"] * math.pi * own["main_rotor.radius"] ** 2
    mass = float(model.body_subtreemass[1])

    def pitch(push, speed, up, across):
        thrust, tip = (
            mass * (loop.gravity + push),
            speed * par[PARAM.main_speed] * par[PARAM.main_radius],
        )
        flow = brentq(lambda v: v - thrust / (2.0 * area * math.hypot(across, v - up)), 0.1, 30.0)
        lift = (
            2.0 * thrust / (area * tip**2) / (par[PARAM.main_lift_slope] * par[PARAM.main_solidity])
        )
        return 3.0 * (lift + 0.5 * (flow - up) / tip)

    travel = par[PARAM.main_pitch_range] * par[PARAM.gyro_collective]
    for flown in ((2.0, 1.0, 0.0, 0.0), (-1.5, 0.9, -1.0, 3.0), (0.0, 1.05, 0.5, 8.0)):
        more = (pitch(*flown) - pitch(0.0, 1.0, 0.0, 0.0)) / travel
        # eight rounds of halving leave 0.4 % of the first guess's error
        assert loop.lifting(*flown) - hover == pytest.approx(more, rel=0.01)


def test_a_script_takes_the_sticks_from_the_pilot_of_plans(jr700):
    """All its gains are 0; beyond 1.4 rad of roll or pitch, or without a place, nobody is asked."""
    plan = FlightPlan(mission=hs.missions.Forward())
    model, data = flight.prepare(jr700, plan, seed=1, number=0), jr700.hovering()
    par = model.actuator_user[addresses(model).rotor]
    par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1] = par[
        [ROLL_ATTITUDE, ROLL_VELOCITY]
    ] = 1.0
    pilot = mission.ScriptedPilot(plan.mission, jr700, model, data, jr700.trim)
    assert par[PARAM.pilot_on] == HANDS_OFF_ROTOR
    assert not par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1].any()
    assert not par[[ROLL_ATTITUDE, ROLL_VELOCITY]].any()
    for angles, ends in (((1.39, -1.39), False), ((-1.41, 0.0), True), ((0.0, 1.41), True)):
        pilot._seen = lambda _, angles=angles: sight(motion=Motion(phi=angles[0], theta=angles[1]))
        assert pilot._tick(data) == ends
    pilot._seen = lambda _: sight(motion=Motion(down=math.nan))
    assert pilot._tick(data)


def test_a_rotor_is_looked_for_again_when_it_can_have_come_down(jr700):
    """At 10 m/s: a second after its lowest rim was 10 m up."""
    contact, level, lowest = Contact(jr700, Ground()), np.eye(3), 0.0
    lowest = max(float(rim[:, 2].max()) for _, rim in outline(jr700).rims())
    assert contact.found(3.0, np.array([0.0, 0.0, -10.0 - lowest]), level, False) == ""
    below = np.array([0.0, 0.0, 0.01 - lowest])
    assert contact.found(3.99, below, level, False) == ""
    assert contact.found(4.01, below, level, False) == "the tail rotor struck the ground"
    assert hover_height(jr700.model) == pytest.approx(0.9 + 0.5 * jr700.model.stat.extent)


def test_sticks_commands_and_servos_are_at_their_limits_where_they_are(jr700):
    """A servo moves all it can at 0.999 of its rate."""
    (truth,) = flight.simulate(jr700, hs.Doublet(axis="lat", duration=4.0, trim_time=1.0), jobs=1)
    assert not any(at.any() for _, at in at_limits(jr700, truth))
    names = "servo_commands", "servo_positions", "sticks"
    sent, there, sticks = (getattr(truth, one).copy() for one in names)
    most = jr700.parameters["servo.rate_limit"] * truth.timestep
    for k, share in enumerate((0.9995, 0.9995, 0.998, -0.9995)):
        sticks[10 * k : 10 * k + 5, k] = -0.5 * (-1.0) ** k
        there[99 + 10 * k :, k] = there[99 + 10 * k, k]
        there[99 + 10 * k :, k] += share * most * np.arange(len(there) - 99 - 10 * k).clip(max=3)
    for k, stick in enumerate(((0.5, 0.0), (0.0, -0.5))):
        sent[200 + 10 * k : 205 + 10 * k, :3] = jr700.swashplate.mix(0.1, *stick)
    sent[220:225, 3] = 0.5
    moved = dict(zip(names, (sent, there, sticks)))
    found = dict(at_limits(jr700, replace(truth, **moved)))
    rows = {name: np.flatnonzero(at[:230]).tolist() for name, at in found.items()}
    wanted = {
        one: [*range(10 * k, 10 * k + 5)] for k, one in enumerate(("COL", "LON", "LAT", "PED"))
    }
    wanted |= {
        one: [*range(200 + 10 * k, 205 + 10 * k)] for k, one in enumerate(("lon", "lat", "ped"))
    }
    wanted |= {f"servo_{one}": [*range(100 + 10 * k, 103 + 10 * k)] for k, one in
               enumerate(("front", "left", "right", "tail"))} | {"servo_right": []}  # fmt: skip
    assert rows == wanted
