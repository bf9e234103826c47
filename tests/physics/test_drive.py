"""What turns the rotor: against data sheets, closed forms and conservation."""

import copy
import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim import FlightPlan, Sweep, fly
from helisim.base.errors import DivergedError
from helisim.base.units import RAD_S_PER_RPM
from helisim.physics import drive
from helisim.physics.battery import Supply, battery_current, battery_rates, supply
from helisim.physics.layout import PARAM, STATE
from helisim.physics.motion import Velocities
from helisim.physics.native import installed
from helisim.physics.rotor import main_rotor, tail_rotor
from helisim.sim.flight import simulate
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.trim import place
from tabled import rows, tabled

MAXON = dict(rows(globals(), "MAXON"))
"""maxon RE 40, 48 V, 150 W, data sheet 148877: voltage, resistance, rpm/V and A without load."""

MAINS = Supply(48.0, 0.0)


def block(**numbers):
    par = np.zeros(len(PARAM))
    for name, number in numbers.items():
        par[getattr(PARAM, name)] = number
    return par


@pytest.fixture(scope="module")
def motor():
    return load("jr700", parameters={"drive.governor": "motor"})


class Bench:
    """A vehicle that hangs still in weightlessness, all its blades without pitch.

    Attributes:
        model: with a body a million times as heavy, unless it is `free`.
        data: at full speed, the motor cut.
        par: parameters.
        act: the vehicle's activations.
    """

    def __init__(self, vehicle, *, free=False, integrator=None, **numbers):
        self.model = model = copy.copy(vehicle.model)
        where = addresses(model)
        self.par = model.actuator_user[where.rotor]
        for name, number in {"gyro_on": 0.0, **numbers}.items():
            self.par[getattr(PARAM, name)] = number
        model.opt.gravity[:] = 0.0
        if integrator is not None:
            model.opt.integrator = integrator
        self.data = mujoco.MjData(model)
        place(model, self.data, vehicle.trim)
        self.data.qpos[3:7], self.data.qvel[:] = [1.0, 0.0, 0.0, 0.0], 0.0
        if not free:
            model.body_mass[:] *= 1e6
            model.body_inertia[:] *= 1e6
            mujoco.mj_setConst(model, mujoco.MjData(model))
        self.act = self.data.act[where.state :]
        self.ctrl = self.data.ctrl[where.control :]
        flat = -self.par[PARAM.main_pitch_trim] / self.par[PARAM.main_pitch_range]
        still = -self.par[PARAM.tail_pitch_trim] / self.par[PARAM.tail_pitch_range]
        positions = [
            *vehicle.swashplate.mix(flat, 0.0, 0.0),
            still * self.par[PARAM.main_direction],
        ]
        self.act[: STATE.flap_a : 2] = self.ctrl[4:8] = positions
        self.act[STATE.flap_a : STATE.flap_b + 1] = 0.0
        self.act[STATE.engine] = self.act[STATE.governor] = 0.0
        self.ctrl[8] = 0.0

    @property
    def speed(self):
        return float(self.act[STATE.speed])

    def run(self, seconds):
        steps = round(seconds / self.model.opt.timestep)
        history = np.empty(steps)
        with installed():
            for k in range(steps):
                mujoco.mj_step(self.model, self.data)
                history[k] = self.speed
        return history


def test_the_motor_has_the_data_sheet_of_one():
    """From four numbers of the sheet its other four, to the three digits that it prints."""
    par = block(**MAXON)
    torque_constant = 1.0 / par[PARAM.drive_speed_constant]
    assert torque_constant == pytest.approx(60.3e-3, rel=3e-3)
    free = 7590.0 * RAD_S_PER_RPM
    standing = drive.engine_torque(par, 1.0, 0.0, MAINS)
    per_speed = drive.engine_torque(par, 1.0, free, MAINS) / standing
    assert per_speed == pytest.approx(0.0, abs=3e-3)
    assert drive.motor_current(par, 1.0, 0.0, MAINS) == pytest.approx(42.4, rel=3e-3)
    assert standing == pytest.approx(2.560, rel=3e-3)
    nominal = 7000.0 * RAD_S_PER_RPM
    slope = (drive.engine_torque(par, 1.0, nominal, MAINS) - 0.187) / standing
    assert slope == pytest.approx(0.0, abs=3e-3)  # of the whole line, from standstill to no load


def test_the_engine_has_its_greatest_power_where_it_should():
    par = block(
        drive_engine=drive.COMBUSTION,
        drive_gear=8.8,
        drive_power=2400.0,
        drive_power_speed=15000.0 * RAD_S_PER_RPM,
        main_speed=15000.0 * RAD_S_PER_RPM / 8.8,
    )
    speeds = np.linspace(0.0, 1.5, 301)
    power = [drive.engine_torque(par, 1.0, s, MAINS) * s * par[PARAM.main_speed] for s in speeds]
    assert speeds[np.argmax(power)] == pytest.approx(1.0)
    assert max(power) == pytest.approx(2400.0)
    assert drive.engine_torque(par, 0.5, 1.0, MAINS) == pytest.approx(
        0.5 * drive.engine_torque(par, 1.0, 1.0, MAINS)
    )


@given(throttle=st.floats(0.0, 1.0), speed=st.floats(0.0, 2.0))
def test_the_freewheel_never_brakes(motor, throttle, speed):
    par = motor.model.actuator_user[addresses(motor.model).rotor]
    free, whole = drive.engine_torque(par, throttle, speed, MAINS), drive.grip(par)
    found = drive.shaft_torque(par, throttle, speed, MAINS)
    assert 0.0 <= found <= max(free, whole)
    assert found == (free if free >= whole else 0.0 if free <= 0.0 else found)


GOVERNOR = {"k_p": 2.0, "k_i": 0.5, "collective_gain": 0.4, "spool_up": 50.0, "lag": 0.1}
GOVERNOR |= {"engine": drive.COMBUSTION, "gear": 8.0, "power": 2e3, "power_speed": 1500.0}
GOVERNOR |= {"bail_out": 0.5, "inertia": 0.1}


@tabled("commanded", "speed", "throttle", "integral", "rate", "growth")
def test_the_governor_is_its_known_law(commanded, speed, throttle, integral, rate, growth):
    par = block(main_speed=180.0, **{f"drive_{name}": one for name, one in GOVERNOR.items()})
    found = drive.governing(par, commanded, 0.05, speed, throttle, integral, MAINS)
    assert found == pytest.approx((rate, growth), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("current", "share"), [(0.9, 1.0), (0.95, 1.0), (0.98, 0.4), (1.0, 0.0), (1.2, 0.0)]
)
def test_the_integral_waits_for_the_currents_limit(current, share):
    par = block(**{**MAXON, "drive_current_limit": 30.0, "main_speed": 100.0})
    volts = 30.0 * current * 1.13 + 0.5 * 100.0 / (158.0 * RAD_S_PER_RPM)
    throttle = volts / 48.0
    assert drive.growth_share(par, throttle, throttle, 0.5, 0.01, MAINS) == pytest.approx(
        min(share, (1.0 - throttle) / 0.05), abs=1e-9
    )


def test_friction_dies_with_the_speed():
    par = block(drive_friction=0.3)
    assert [drive.friction(par, speed) for speed in (0.0, 0.01, 0.02, 1.3)] == [0.0, 0.15, 0.3, 0.3]


@pytest.mark.parametrize("name", ["RK4", "Euler"])
def test_a_rotor_without_load_runs_down_as_profile_drag_has_it(motor, name):
    """Omega = Omega0 / (1 + k t), the closed form of a torque that goes with Omega^2.

    k from the books' CQ = sigma c_d0 / 8 of both rotors, without a line of the force laws. 1e-6
    is the last digit of the speed in ten seconds of Runge-Kutta; Euler holds the aerodynamic
    torque for the step, which is k dt = 1e-3 of it late.
    """
    kind = getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}")
    bench = Bench(motor, integrator=kind, drive_friction=0.0)
    own = motor.parameters
    load_ = 0.0
    for part in ("main_rotor", "tail_rotor"):
        radius, spin = own[f"{part}.radius"], own[f"{part}.speed"]
        solidity = own[f"{part}.blades"] * own[f"{part}.chord"] / (math.pi * radius)
        area = math.pi * radius**2
        coefficient = solidity * own["main_rotor.profile_drag"] / 8.0
        power = own["air.density"] * area * (spin * radius) ** 3 * coefficient
        load_ += power / own["main_rotor.speed"]
    k = load_ / (own["drive.inertia"] * own["main_rotor.speed"])
    history = bench.run(10.0)
    time = bench.model.opt.timestep * np.arange(1, history.size + 1)
    assert history == pytest.approx(1.0 / (1.0 + k * time), rel=1e-6 if name == "RK4" else 1e-3)
    assert history[-1] < 0.6


def test_turning_the_rotor_turns_the_body_back(motor):
    """Angular momentum about the mast is kept where the air takes none.

    Free in space, blades without pitch or drag: body and blades have as much as at the start while
    the motor takes the rotor from rest to speed, which is that in the body. The law of
    conservation, to rounding of the steps; I_zz has the blades as if they turned with the body.
    """
    bench = Bench(motor, free=True, main_profile_drag=0.0, air_density=1e-12)
    bench.act[STATE.speed], bench.ctrl[8] = 0.0, 1.0
    bench.run(10.0)
    own = motor.parameters
    blades = own["drive.inertia"]  # on the mast: the flapping's blades have no less
    r = -bench.data.qvel[5]  # clockwise, as the blades turn
    spin = own["main_rotor.speed"] * bench.speed
    assert (own["airframe.izz"] - blades) * r == pytest.approx(-blades * spin, rel=1e-6)
    assert spin - r == pytest.approx(own["main_rotor.speed"], rel=1e-3)  # as the governor has it


def test_the_shaft_turns_by_the_body_s_yaw_rate_less(motor):
    """dQ_shaft/dr is the back-EMF's torque at a speed: (n/k_V)^2 / R of the data sheet.

    A body that turns with the blades takes speed from the motor, whose torque is what turns them
    and, against the body, the gears; 1e-6: of the central difference.
    """
    own, found = motor.parameters, []
    for r in (1e-3, -1e-3):
        bench = Bench(motor, free=True, main_profile_drag=0.0, air_density=1e-9)
        place(bench.model, bench.data, motor.trim)
        bench.data.qvel[5] = -r
        with installed():
            mujoco.mj_forward(bench.model, bench.data)
        found.append(bench.act[STATE.speed_rate])
    slope = own["drive.inertia"] * own["main_rotor.speed"] * (found[0] - found[1]) / 2e-3
    per_speed = (own["drive.gear"] / own["drive.speed_constant"]) ** 2 / own["drive.resistance"]
    assert slope == pytest.approx(per_speed, rel=1e-6)


def test_in_autorotation_the_body_feels_friction_alone(motor):
    """Cut, with no load on the tail: what the mast hands on is the friction of the gears."""
    bench, own = Bench(motor, free=True, tail_solidity=1e-12), motor.parameters
    with installed():
        mujoco.mj_forward(bench.model, bench.data)
    yaw = -bench.data.qacc[5] * (own["airframe.izz"] - own["drive.inertia"])
    assert yaw == pytest.approx(own["drive.friction"], rel=1e-6)


@given(
    speed=st.floats(0.0, 0.2),
    wind=st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    col=st.floats(-0.5, 0.5),
)
def test_a_slow_rotor_has_finite_forces_in_any_wind(jr700, speed, wind, col):
    """An advance ratio of a hundred, or none: numbers, and small ones where the rotor stands."""
    par = jr700.model.actuator_user[addresses(jr700.model).rotor]
    motion = Velocities(*wind, 0.1, 0.1, 0.1)
    main = main_rotor(par, motion, speed, col, (0.1, -0.1), (0.1, 0.1))
    tail = tail_rotor(par, motion, speed, col)
    assert np.all(np.isfinite([*main, *tail]))
    if speed == 0.0:
        assert [main.thrust, main.torque, tail.thrust, tail.torque] == [0.0] * 4


LIPO = {"cells": 12.0, "capacity": 28800.0, "charge": 1.0, "temperature": 298.15}
LIPO |= {"voltage_0": 3.685, "voltage_1": 0.2156, "voltage_2": -0.1178, "voltage_3": 0.3201}
LIPO |= {"end_voltage": 1.031, "end": 35.0, "resistance": 0.012, "activation": 3131.0}
LIPO |= {"polarisation": 0.008, "lag": 33.0, "heat_capacity": 2200.0, "cooling": 0.0}


def test_the_battery_is_the_one_that_was_measured():
    """Cells of Chen and Rincon-Mora (2006), and the pack that rcex.cz measured in the cold (2010).

    At rest 4.10 V full and 2.65 V empty; 1.1e-6 exp(3131 / T) ohm: 2.92 times as much at 273 K
    as at 303 K. To the digits that are printed.
    """
    par = block(drive_supply=1.0, **{f"battery_{name}": one for name, one in LIPO.items()})
    voltage = [supply(par, taken, 0.0, 0.0).voltage / 12.0 for taken in (0.0, 0.5, 1.0)]
    assert voltage == pytest.approx([4.1029, 3.8034, 2.654], abs=1e-4)
    cold, warm = (supply(par, 0.5, 0.0, rise).resistance for rise in (-25.15, 4.85))
    assert cold / warm == pytest.approx(math.exp(3131.0 / 273.0 - 3131.0 / 303.0), rel=1e-9)
    source = Supply(48.0, 0.012)
    current = battery_current(source, 30.0, 40.0)
    assert (48.0 - 0.012 * current) * current == pytest.approx(1200.0, rel=1e-12)
    rates = battery_rates(par, source, 40.0, 0.2, 0.0)
    assert rates == pytest.approx((40.0 / 28800.0, 0.12 / 33.0, (19.2 + 5.0) / 2200.0), rel=1e-12)


def test_a_battery_empties_and_the_flight_says_so(motor):
    """Charge taken is the current's integral; what it gives is work and heat, or it is missing.

    1e-6 of a whole: of the trapezoids of a sweep's samples. The governor's headroom goes with the
    charge: more throttle for the same hover.
    """
    fed = {"drive.governor": "motor", "drive.supply": "battery"}
    low = load("jr700", parameters=fed | {"battery.charge": 0.03})
    full = load("jr700", parameters=fed)
    assert full.trim.throttle < low.trim.throttle < 1.0
    plan = FlightPlan(excitation=Sweep(axis="col", duration=60.0))
    with pytest.raises(DivergedError, match=r"emptied its battery at .* or give battery.capacity"):
        fly(low, plan, count=1)
    (flight,) = simulate(full, FlightPlan(excitation=Sweep(axis="col", duration=12.0)), seed=1)
    volts, amperes, charge, _ = flight.battery.T
    own, spin = full.parameters, flight.rotor_speed[:, 0] - flight.rates[:, 2]

    def summed(power):
        return np.trapezoid(power, dx=flight.timestep)

    assert summed(amperes) == pytest.approx(28800.0 * (charge[0] - charge[-1]), rel=1e-6)
    work = flight.power[:, 0] + own["drive.friction"] * spin
    turns = own["drive.gear"] / own["drive.speed_constant"]
    current = work / spin / turns + own["drive.no_load_current"]
    heat = (own["drive.resistance"] - own["battery.resistance"]) * current**2
    heat += own["drive.no_load_current"] * turns * spin
    assert summed(volts * amperes) == pytest.approx(summed(work + heat), rel=1e-6)


def test_a_turbine_is_padfield_s():
    """Torque over speed is -(1 + T_e2 s) / ((1 + T_e1 s)(1 + T_e3 s)) / droop (Padfield, ch. 3).

    Of the hover's linear model, at three frequencies, to its differences' rounding. At a third less
    throttle the speed that the governor holds is a third of the droop's share higher.
    """
    lags = {"drive.fuel_lag": 0.1, "drive.lead": 0.2, "drive.lag": 0.5}
    lynx = load("lynx", parameters={"drive.governor": "motor"} | lags)
    linear, own = lynx.linearize(), lynx.parameters
    ends = [linear.states.index(name) for name in ("engine", "fuel")]
    block_, by_speed = linear.a[np.ix_(ends, ends)], linear.a[ends, linear.states.index("speed")]
    for s in 1j * np.array([0.1, 1.0, 10.0]):
        engine, fuel = np.linalg.solve(s * np.eye(2) - block_, by_speed)
        torque = engine + own["drive.lead"] / own["drive.lag"] * (fuel - engine)
        wanted = -(1.0 + 0.2 * s) / (1.0 + 0.1 * s) / (1.0 + 0.5 * s) / own["drive.droop"]
        assert torque == pytest.approx(wanted, rel=1e-6)
    par = lynx.model.actuator_user[addresses(lynx.model).rotor]
    speed = 1.0 + own["drive.droop"] * lynx.trim.throttle / 3.0
    less = 2.0 / 3.0 * lynx.trim.throttle
    held = drive.governing(par, 1.0, 0.0, speed, less, lynx.trim.throttle, MAINS)
    assert held == pytest.approx((0.0, 0.0), abs=1e-12)
