"""The compiled callbacks of every evaluation of the dynamics, installed in MuJoCo for a block.

They read and write nothing but mjModel and mjData, so threads and vehicles can share them.
"""

import logging
import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numba import cfunc, types

from helisim.base.errors import CallbackError
from helisim.physics import controller, memory
from helisim.physics.air import write_turbulence_rates
from helisim.physics.drive import drive
from helisim.physics.flapping import keep_rates
from helisim.physics.flow import flow, flow_later, heat, wrench
from helisim.physics.gyro import servo_rates
from helisim.physics.kernel import (
    CallbackCompiler,
    buffer,
    compiled_or_cached,
    fingerprint,
    kernel,
)
from helisim.physics.laws import LOCK, WATCHED
from helisim.physics.layout import CONTROL, PARAM, ROTOR, SENSOR, STATE
from helisim.physics.memory import (
    ACTUATION_OFF,
    PASSIVE_OFF,
    TIME_TOLERANCE,
    examine_new,
    held_for,
    is_rotor,
    is_tick,
    last_tick,
    long,
    offsets,
    sensor_numbers,
    states_end,
    view_of,
)
from helisim.physics.motion import apply_wrench, contact_force
from helisim.physics.pilot import fly

_ACCELERATION_STAGE = int(mujoco.mjtStage.mjSTAGE_ACC)
_DRIVEN = STATE.tail_rate + 1  # count of the servos' states, the first ones
_RATES_KEPT = STATE.flap_a_rate - STATE.flap_a  # of the rotor's states, behind them
_HOOKS = ("passive", "control", "act_dyn", "sensor")
_TIMER = "time"  # MuJoCo's clock for `mjData.timer`, stopped unless someone set one
_PATIENCE = 2.0  # s of compiling before a message
_logger = logging.getLogger(__name__)


@kernel()
def for_each_vehicle(m, d, offsets, act):
    """Call a kernel with a view of every vehicle in a model."""
    for rotor in range(ROTOR, long(m, offsets.nactuator)):
        if is_rotor(m, offsets, rotor):
            act(view_of(m, d, offsets, rotor))


@kernel()
def add_forces(view):
    """Add a vehicle's aerodynamic forces: what mjcb_passive does."""
    step = held_for(view)
    past = flow(view, 0.5 * step)
    keep_rates(view, past, step)
    act, is_dynamic = view.act, view.par[PARAM.main_dynamic_inflow] != 0.0
    if step > 0.0 and is_dynamic:
        mean = act[STATE.inflow_0] + step * act[STATE.inflow_0_rate]
        past = flow_later(view, past, mean, 0.5 * step)
    driven = drive(view, past, step)
    for k in range(STATE.warming - STATE.speed + 1):
        act[STATE.speed_rate + k] = driven.rates[k]
    a = act[STATE.flap_a] + step * act[STATE.flap_a_rate]
    b = act[STATE.flap_b] + step * act[STATE.flap_b_rate]
    apply_wrench(view, wrench(view.par, a, b, past, driven.mast))


@kernel()
def command(view):
    """Fly a vehicle: pilot to sticks, gyro to servo commands. What mjcb_control does."""
    if view.sensors < 0 or not is_tick(view):
        return
    if view.par[PARAM.pilot_on] != 0.0:
        fly(view)
    if view.par[PARAM.gyro_on] != 0.0:
        controller.command_servos(view)


@kernel()
def write_rates(m, d, offsets, actuator):
    """Write the derivatives of a vehicle's activations, at the turn of its rotor, the last."""
    if not is_rotor(m, offsets, actuator):
        return 0.0
    view = view_of(m, d, offsets, actuator)
    controls, tick, step = view.controls, last_tick(view), held_for(view)
    commands = (
        controls[CONTROL.servo_front],
        controls[CONTROL.servo_left],
        controls[CONTROL.servo_right],
        controls[CONTROL.servo_tail],
    )
    commands = controller.at_actuators(view, commands)
    write_servo_rates(view.par, view.act, view.rate, commands, tick)
    if step > 0.0:
        average_servo_rates(view.par, view.act, view.rate, commands, tick, step)
    for k in range(STATE.flap_a, STATE.warming + 1):
        view.rate[k] = view.act[k + _RATES_KEPT]
    write_turbulence_rates(view, step)
    for k in range(STATE.feels_x, states_end(view)):  # written at ticks, not integrated
        view.rate[k] = 0.0
    return 0.0


@kernel(forceinline=False)
def write_servo_rates(par, act, rate, commands, tick):
    """Write the derivatives of the servos' states; commands: (4,); tick: s, of the last."""
    for k in range(4):
        position, fault = STATE.front_position + 2 * k, PARAM.front_fault_at + 4 * k
        frequency, damping = par[PARAM.swash_frequency], par[PARAM.swash_damping]
        if k == 3:
            frequency, damping = par[PARAM.tail_frequency], par[PARAM.tail_damping]
        command, limit = commands[k], par[PARAM.servo_rate_limit]
        if par[PARAM.faults] != 0.0 and tick >= par[fault] - TIME_TOLERANCE:
            limit = min(par[fault + 1], limit)
            command = min(par[fault + 3], max(par[fault + 2], command))
        rate[position], rate[position + 1] = servo_rates(
            act[position],
            act[position + 1],
            command,
            frequency,
            damping,
            limit,
            par[PARAM.servo_travel],
        )
        if limit < par[PARAM.servo_rate_limit]:
            # slowed by a fault: frequency / (2 damping) times the error, limited
            wanted = 0.5 * frequency / damping * (command - act[position])
            wanted = min(limit, max(-limit, wanted))
            rate[position + 1] = 2.0 * damping * frequency * (wanted - act[position + 1])


@kernel()
def average_servo_rates(par, act, rate, commands, tick, step):
    """Make the derivatives of the servos' states their mean over a step (s)."""
    stage = buffer(_DRIVEN)
    for divisor in (6.0, 5.0, 4.0, 3.0, 2.0):
        for k in range(_DRIVEN):
            stage[k] = act[k] + step / divisor * rate[k]
        write_servo_rates(par, stage, rate, commands, tick)


@kernel()
def report(view):
    """Write what the recorder needs beside MuJoCo's own sensors. What mjcb_sensor does."""
    if view.sensors < 0:
        return
    act, rate, out = view.act, view.rate, sensor_numbers(view)
    for k in range(CONTROL.rotor):
        out[SENSOR.stick_col + k] = view.controls[k]
    if controller.has_failed(view):
        for k in range(4):
            out[SENSOR.command_front + k] = math.nan
    for k in range(4):
        out[SENSOR.position_front + k] = act[STATE.front_position + 2 * k]
    since = 0.5 * held_for(view)  # by which tilt and inflow are kept early
    out[SENSOR.flap_a] = act[STATE.flap_a] + since * rate[STATE.flap_a]
    out[SENSOR.flap_b] = act[STATE.flap_b] + since * rate[STATE.flap_b]
    past = flow(view, 0.0)
    if since > 0.0 and view.par[PARAM.main_dynamic_inflow] != 0.0:
        past = flow_later(view, past, act[STATE.inflow_0] + since * rate[STATE.inflow_0], 0.0)
    report_rotors(view, past)
    contact = contact_force(view)
    out[SENSOR.contact_north], out[SENSOR.contact_east], out[SENSOR.contact_down] = contact
    controller.feel(view)


@kernel()
def report_rotors(view, past):
    """Write what the sensors say of the rotors and the air, from the `Flow`."""
    out, main, air = sensor_numbers(view), past.main, past.air
    out[SENSOR.thrust], out[SENSOR.torque], out[SENSOR.inflow] = (
        main.thrust,
        main.torque,
        main.inflow,
    )
    out[SENSOR.tail_thrust], out[SENSOR.speed] = past.tail.thrust, past.speed
    spin = past.speed * view.par[PARAM.main_speed]
    driven = drive(view, past, 0.0)
    out[SENSOR.drive_power], out[SENSOR.main_power] = driven.power, main.torque * spin
    out[SENSOR.tail_power] = past.tail.torque * past.shaft * view.par[PARAM.tail_speed]
    out[SENSOR.voltage], out[SENSOR.current] = driven.voltage, driven.current
    if driven.voltage > 0.0:
        out[SENSOR.charge] = view.par[PARAM.battery_charge] - view.act[STATE.discharge]
        out[SENSOR.temperature] = view.par[PARAM.battery_temperature] + view.act[STATE.warming]
    out[SENSOR.heat] = heat(view.par, past)
    out[SENSOR.air_u], out[SENSOR.air_v], out[SENSOR.air_w] = air.u, air.v, air.w
    out[SENSOR.air_p], out[SENSOR.air_q], out[SENSOR.air_r] = air.p, air.q, air.r


_lock = threading.Lock()
_blocks = 0  # count of open blocks


@cache
def compiled() -> dict[str, Any]:
    """Return the compiled callback of each hook, cached on disk beside the package if possible."""
    message = "compiling the force laws; they are kept for the next start"
    patience = threading.Timer(_PATIENCE, _logger.info, [message])
    patience.daemon = True
    patience.start()
    try:
        return compiled_or_cached(_compile)
    finally:
        patience.cancel()


def _compile(cached: bool) -> dict[str, Any]:
    layout, address = offsets()._replace(fingerprint=fingerprint()), types.int64
    options: dict[str, Any] = {"cache": cached, "pipeline_class": CallbackCompiler}

    @cfunc(types.void(address, address), **options)
    def passive(m, d):
        examine_new(m, d, layout, ACTUATION_OFF)
        for_each_vehicle(m, d, layout, add_forces)

    @cfunc(types.void(address, address), **options)
    def control(m, d):
        examine_new(m, d, layout, 0)
        for_each_vehicle(m, d, layout, command)

    @cfunc(types.float64(address, address, types.int32), **options)
    def act_dyn(m, d, actuator):
        # as wide as an index elsewhere, or most kernels would be compiled a second time
        return write_rates(m, d, layout, np.int64(actuator))

    @cfunc(types.void(address, address, types.int32), **options)
    def sensor(m, d, stage):
        if stage == _ACCELERATION_STAGE:
            examine_new(m, d, layout, ACTUATION_OFF | PASSIVE_OFF)
            for_each_vehicle(m, d, layout, report)

    @cfunc(types.float64(), **options)
    def time():
        return 0.0

    return dict(zip((*_HOOKS, _TIMER), (passive, control, act_dyn, sensor, time)))


@contextmanager
def installed() -> Iterator[None]:
    """Install the helicopter's force laws in MuJoCo while the block runs.

    Raises CallbackError if another callback is installed or the memory layout is unknown, and at
    the end, if a stepped model lacks something or its controller failed.
    """
    _enter()
    try:
        yield
    except BaseException as error:
        for one in _leave():
            error.add_note(one)
        raise
    if said := _leave():
        raise CallbackError("\n".join(said))


def _enter() -> None:
    global _blocks
    with _lock:
        if _blocks == 0:
            functions = compiled()
            taken = [hook for hook in _HOOKS if getattr(mujoco, f"get_mjcb_{hook}")() is not None]
            if taken:
                raise CallbackError(
                    "MuJoCo already has a callback of another owner, and keeps one for the whole "
                    f"process; remove it first, with mujoco.set_mjcb_{taken[0]}(None)"
                )
            unset = (_TIMER,) if mujoco.get_mjcb_time() is None else ()
            for hook in (*_HOOKS, *unset):
                getattr(mujoco, f"set_mjcb_{hook}")(functions[hook].ctypes)
            memory.forget_models()
        _blocks += 1


def _leave() -> list[str]:
    global _blocks
    with _lock:
        _blocks -= 1
        found = memory.taken()
        for hook in () if _blocks else (*_HOOKS, _TIMER):  # but one that someone put in place
            if getattr(mujoco, f"get_mjcb_{hook}")() is compiled()[hook].ctypes:
                getattr(mujoco, f"set_mjcb_{hook}")(None)
    with LOCK:
        kept = list(WATCHED)
    failures = ((one.law.name, failure) for one in kept if (failure := one.failure()) is not None)
    return found + [
        f"controller {name!r} {failure.why}\n{failure.traceback}".rstrip()
        for name, failure in failures
    ]
