"""The callbacks of every evaluation of the dynamics, compiled and lent to MuJoCo for a block.

Each callback takes the addresses of mjModel and mjData and the field offsets. It reads and writes
nothing but those two, so any number of threads and vehicles can share it.
"""

import ctypes
import logging
import math
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numba import cfunc, types

from helisim.base.errors import CallbackError, InputError
from helisim.physics import controller, memory
from helisim.physics.air import write_turbulence_rates
from helisim.physics.drive import drive
from helisim.physics.flapping import keep_tilt_and_inflow_rates, tilt_rates
from helisim.physics.flow import flow, flow_later, heat, wrench
from helisim.physics.gyro import write_servo_rates
from helisim.physics.kernel import (
    CallbackCompiler,
    buffer,
    compiled_or_cached,
    fingerprint,
    kernel,
)
from helisim.physics.laws import LOCK, WATCHED
from helisim.physics.layout import CONTROL, MAGIC, PARAM, ROTOR, SENSOR, STATE
from helisim.physics.memory import (
    ACTUATION_OFF,
    PASSIVE_OFF,
    Remark,
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
_DRIVEN = STATE.tail_rate + 1
"""The first states of a vehicle, those of the servos, which held commands alone drive."""
_RATES_KEPT = STATE.flap_a_rate - STATE.flap_a
"""Distance of the rates of the rotor's states behind these."""
_HOOKS = ("passive", "control", "act_dyn", "sensor")
_TIMER = "time"
"""MuJoCo's Python package reads the clock some twenty times a step, for `mjData.timer`: a third
of the cost of a step. So the timer stands still meanwhile, unless someone has set one."""
_PATIENCE = 2.0
"""s without a word; from the cache the code is there sooner."""
_logger = logging.getLogger(__name__)


@kernel()
def add_forces(m, d, offsets):
    """Add the aerodynamic forces of every vehicle: what mjcb_passive does.

    What its rotors do is found here, once in each evaluation, and all that follows from it is
    written at once. MuJoCo clears `act_dot` afterwards, so the rates of the rotor's states wait
    among the activations.
    """
    examine_new(m, d, offsets, ACTUATION_OFF)
    for rotor in range(ROTOR, long(m, offsets.nactuator)):
        if not is_rotor(m, offsets, rotor):
            continue
        view = view_of(m, d, offsets, rotor)
        step = held_for(view)
        past = flow(view, 0.5 * step)
        act, is_dynamic = view.act, view.par[PARAM.main_dynamic_inflow] != 0.0
        if is_dynamic:
            keep_tilt_and_inflow_rates(view, past, step)
        else:
            act[STATE.flap_a_rate], act[STATE.flap_b_rate] = tilt_rates(view, past, step)
            for k in range(STATE.inflow_0_rate, STATE.inflow_c_rate + 1):
                act[k] = 0.0
        if step > 0.0 and is_dynamic:
            mean = act[STATE.inflow_0] + step * act[STATE.inflow_0_rate]
            past = flow_later(view, past, mean, 0.5 * step)
        driven = drive(view, past, step)
        act[STATE.speed_rate], act[STATE.engine_rate] = driven.speed_rate, driven.engine_rate
        act[STATE.governor_rate] = driven.governor_rate
        a = act[STATE.flap_a] + step * act[STATE.flap_a_rate]
        b = act[STATE.flap_b] + step * act[STATE.flap_b_rate]
        apply_wrench(view, wrench(view.par, a, b, past, driven.mast))


@kernel()
def fly_vehicles(m, d, offsets):
    """Fly every vehicle: pilot to sticks, gyro to servo commands. What mjcb_control does.

    Both act at the gyro's ticks; in between, sticks and servo commands are held. A model that is
    new is examined first.
    """
    examine_new(m, d, offsets, 0)
    for rotor in range(ROTOR, long(m, offsets.nactuator)):
        if not is_rotor(m, offsets, rotor):
            continue
        view = view_of(m, d, offsets, rotor)
        if view.sensors < 0 or not is_tick(view):
            continue
        if view.par[PARAM.pilot_on] != 0.0:
            fly(view)
        if view.par[PARAM.gyro_on] != 0.0:
            controller.command_servos(view)


@kernel()
def write_rates(m, d, offsets, actuator):
    """Write the derivatives of a vehicle's activations, at the turn of its rotor, the last.

    What mjcb_act_dyn does. Those of the rotor were found with the forces.
    """
    if not is_rotor(m, offsets, actuator):
        return 0.0
    view = view_of(m, d, offsets, actuator)
    commands, limits = held_commands(view)
    step = held_for(view)
    if step > 0.0:
        write_mean_servo_rates(view.par, commands, limits, view.act, view.rate, step)
    else:
        write_servo_rates(view.par, view.act, view.rate, commands, limits)
    for k in range(STATE.flap_a, STATE.governor + 1):
        view.rate[k] = view.act[k + _RATES_KEPT]
    write_turbulence_rates(view, step)
    for k in range(STATE.feels_x, states_end(view)):  # written at ticks, not integrated
        view.rate[k] = 0.0
    return 0.0


@kernel()
def held_commands(view):
    """Return the commands that a vehicle's servos can follow, and how fast each can be, 1/s.

    Of the front, left, right and tail servo, unitised. They are held between the gyro's ticks, so
    the body's motion within a step does not reach them.
    """
    par, controls = view.par, view.controls
    commands = (
        controls[CONTROL.servo_front],
        controls[CONTROL.servo_left],
        controls[CONTROL.servo_right],
        controls[CONTROL.servo_tail],
    )
    commands = controller.at_actuators(view, commands)
    limit = par[PARAM.servo_rate_limit]
    limits = (limit, limit, limit, limit)
    if par[PARAM.faults] != 0.0:
        return controller.faulty_servos(par, last_tick(view), commands, limits)
    return commands, limits


@kernel()
def write_mean_servo_rates(par, commands, limits, act, rate, step):
    """Write the mean derivatives of the servos' states over a time step with held commands.

    The Taylor series of the exponential, from the inside out, to sixth order where the laws
    are linear: with servos of 222 rad/s and steps of 2 ms, exact to 1e-6.

    commands: of the four servos, unitised, (4,); limits: how fast each can be, 1/s, (4,); act:
    states of the vehicle; rate: their mean derivatives, written; step: s.
    """
    stage = buffer(_DRIVEN)
    write_servo_rates(par, act, rate, commands, limits)
    for divisor in (6.0, 5.0, 4.0, 3.0, 2.0):
        for k in range(_DRIVEN):
            stage[k] = act[k] + step / divisor * rate[k]
        write_servo_rates(par, stage, rate, commands, limits)


@kernel()
def write_sensors(m, d, offsets, stage):
    """Write what the recorder needs beside MuJoCo's own sensors. What mjcb_sensor does."""
    if stage != _ACCELERATION_STAGE:
        return
    examine_new(m, d, offsets, ACTUATION_OFF | PASSIVE_OFF)
    for rotor in range(ROTOR, long(m, offsets.nactuator)):
        if not is_rotor(m, offsets, rotor):
            continue
        view = view_of(m, d, offsets, rotor)
        if view.sensors >= 0:
            report(view)
            controller.feel(view)


@kernel()
def report(view):
    """Write the numbers of a vehicle's own sensors."""
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
    out[SENSOR.drive_power] = drive(view, past, 0.0).power
    out[SENSOR.main_power] = main.torque * spin
    out[SENSOR.tail_power] = past.tail.torque * past.speed * view.par[PARAM.tail_speed]
    out[SENSOR.heat] = heat(view.par, past)
    out[SENSOR.air_u], out[SENSOR.air_v], out[SENSOR.air_w] = air.u, air.v, air.w
    out[SENSOR.air_p], out[SENSOR.air_q], out[SENSOR.air_r] = air.p, air.q, air.r


class _Loan:
    """The callbacks that MuJoCo has, and for how many blocks, `own.depth` of them this thread's."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.blocks = 0
        self.functions: dict[str, Any] = {}
        self.own = threading.local()
        self.unsaid: list[Remark] = []


_loan: _Loan = globals().get("_loan") or _Loan()
"""A module that is loaded again, as notebooks do, finds the blocks that are open."""


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
        add_forces(m, d, layout)

    @cfunc(types.void(address, address), **options)
    def control(m, d):
        fly_vehicles(m, d, layout)

    @cfunc(types.float64(address, address, types.int32), **options)
    def act_dyn(m, d, actuator):
        # as wide as an index elsewhere, or most kernels would be compiled a second time
        return write_rates(m, d, layout, np.int64(actuator))

    @cfunc(types.void(address, address, types.int32), **options)
    def sensor(m, d, stage):
        write_sensors(m, d, layout, stage)

    @cfunc(types.float64(), cache=cached)
    def time():
        return 0.0

    found = (passive, control, act_dyn, sensor, time)
    return dict(zip((*_HOOKS, _TIMER), found))


@contextmanager
def installed() -> Iterator[None]:
    """Lend MuJoCo the helicopter's force laws while the block runs.

    The callbacks are global to the process, so blocks may nest and overlap between threads;
    the last to leave removes them. They leave every model alone that is not ours; only
    MuJoCo's profiling timers, `mjData.timer`, stand still meanwhile. Any number of helicopters
    may share a scene, attached with prefixes. A daemon thread that steps when the interpreter
    ends crashes MuJoCo 4.0.0, with these callbacks as without: join it.

    A model with a vehicle that lacks what the force laws count on is not flown, or flies without
    its gyro; the outermost block of a thread says so when it ends. It warns of user actuators
    that are of no vehicle.

    Raises:
        CallbackError: someone else's callback is installed, or this MuJoCo's memory layout
            is not what it says; when the block ends, a model that was stepped in it lacks
            something, or a controller that was set in one failed. An exception from within the
            block comes first, with that as its note.
    """
    with _loan.lock:
        if _loan.blocks == 0:
            _install(compiled())
            memory.forget_models()
        _loan.blocks += 1
    _loan.own.depth = getattr(_loan.own, "depth", 0) + 1
    try:
        yield
    except BaseException as error:
        for one in [*(remark.text for remark in _leave()), *_watched_failures()]:
            error.add_note(one)
        raise
    else:
        found = _leave()
        for remark in found:
            if not remark.refused:
                warnings.warn(remark.text, RuntimeWarning, stacklevel=3)
        for remark in found:
            if remark.refused:
                raise CallbackError(remark.text)
        failures = _watched_failures()
        if failures:
            error = CallbackError(failures[0])
            for one in failures[1:]:
                error.add_note(one)
            raise error


def _leave() -> list[Remark]:
    """Leave a block; return what was remarked, if it was the outermost of this thread."""
    with _loan.lock:
        _loan.blocks -= 1
        _loan.own.depth -= 1
        found: list[Remark] = []
        if _loan.own.depth <= 0:
            found = _loan.unsaid + memory.taken()
            _loan.unsaid = []
        if _loan.blocks == 0:
            _remove(_loan.functions)
    return found


def check_is_model(model: object) -> None:
    """Raise InputError unless it is a compiled model of MuJoCo's."""
    if not isinstance(model, mujoco.MjModel):
        raise InputError(
            f"a mujoco.MjModel is needed, such as from_xml_path(...) gives, got {model!r:.80}"
        )


def check_model(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the bodies of helisim's vehicles in a model, each with all it needs.

    What `installed` would say at the end of a block, said at once and without a step.

    Raises:
        CallbackError: a vehicle lacks something, or there is none; the message names the element
            and what to do.
        InputError: it is no mujoco.MjModel.
    """
    check_is_model(model)
    for remark in memory.examine(model._address):
        if remark.refused:
            raise CallbackError(remark.text)
    bodies = []
    if model.nuser_actuator >= len(PARAM):
        for actuator, user in enumerate(model.actuator_user):
            if user[PARAM.magic] == MAGIC and user[PARAM.ordinal] == ROTOR:
                joint = model.actuator_trnid[actuator, 0]
                bodies.append(model.body(model.jnt_bodyid[joint]).name)
    if not bodies:
        name = model.names.split(b"\0")[0].decode()
        raise CallbackError(
            f"model {name!r} has no helicopter of helisim: no actuator has its user numbers. Write "
            "them into a vehicle's MJCF with `helisim vehicle build FOLDER`"
        )
    return tuple(bodies)


def _install(functions: dict[str, Any]) -> None:
    taken = [hook for hook in _HOOKS if getattr(mujoco, f"get_mjcb_{hook}")() is not None]
    if taken:
        names = ", ".join(f"mjcb_{hook}" for hook in taken)
        raise CallbackError(
            f"MuJoCo already has a callback of another owner: {names}. MuJoCo keeps one for "
            f"the whole process; remove it first, with mujoco.set_{names.split(', ')[0]}(None)"
        )
    _loan.functions = functions  # which must live as long as MuJoCo calls them
    unset = (_TIMER,) if mujoco.get_mjcb_time() is None else ()
    for hook in (*_HOOKS, *unset):
        getattr(mujoco, f"set_mjcb_{hook}")(functions[hook].ctypes)


def _remove(functions: dict[str, Any]) -> None:
    """Take our callbacks out again, and leave one that someone put in their place."""
    for hook in (*_HOOKS, _TIMER):
        if _address(getattr(mujoco, f"get_mjcb_{hook}")()) == functions[hook].address:
            getattr(mujoco, f"set_mjcb_{hook}")(None)


def _address(callback: Any) -> int | None:
    """Return the address of a native callback; a Python function has none."""
    try:
        return ctypes.cast(callback, ctypes.c_void_p).value
    except ctypes.ArgumentError:
        return None


def _watched_failures() -> list[str]:
    """Return how laws failed that stay in models, each in one text; then they count as said."""
    with LOCK:
        kept = list(WATCHED)
    return [
        f"controller {one.law.name!r} {failure.why}\n{failure.traceback}".rstrip()
        for one in kept
        if (failure := one.failure()) is not None
    ]
