"""Flies Rotorflight's law, and logs it as its Blackbox does: columns of whole numbers, a header."""

import math
from dataclasses import replace

import numba
import numpy as np
from scipy.signal import bessel, lfilter

import helisim as hs
from helisim.design.laws import rotorflight_kernel as kernel
from helisim.design.laws.rotorflight import TAIL_PITCH
from helisim.sim.flight import simulate
from helisim.sim.missions import Everyday

TAIL = {"p": 15.0, "i": 15.0, "d": 0.0, "rate": 180.0}
AHEAD = {"collective_ff_gain": 45.0, "cyclic_ff_gain": 0.0}
SINCE_START = 20_000_000  # us, since power-on
ACC_1G, ACC_LPF = 2048, 10.0  # Hz, of the accelerometer's Bessel low-pass
# what gyro, deg/s, and accelerometer, g, feel beside the motion: noise, rms, and one per revolution
TURNED, SHAKEN = (1.0, 2.0), (0.005, 0.1)
LOOPTIME = 125  # us, of the gyro


def law_for(vehicle):
    """Return gains that fly a vehicle: the firmware's own, of the Blade 360 another tail's.

    The tail servo of that model moves the blades by 7 degrees in all, where a mixer's 1 is 24.
    """
    law = hs.Rotorflight.of(vehicle)
    return replace(law, yaw=replace(law.yaw, **TAIL, **AHEAD)) if "360" in vehicle.name else law


@numba.njit
def logged_loop(seen, state, settings):
    wanted, gyro, roll, pitch, yaw = kernel.loop(seen, state, settings)
    mixed = kernel.mixed(state, settings, wanted, roll, pitch, yaw)
    servos = kernel.servos(settings, mixed[0], mixed[1], mixed[2], mixed[3])
    return wanted + gyro + roll + pitch + yaw + mixed, servos


class Logging:
    """A controller that flies a law, and keeps each loop's numbers in `rows`."""

    def __init__(self, law, vehicle, seed=0):
        self.rows, settings, rng = [], law.on(vehicle).settings, np.random.default_rng(seed)
        speed, rows = vehicle.parameters["main_rotor.speed"], self.rows

        def begin(seen, state, settings):
            rows.clear()  # what a pilot's gains needed before
            kernel.rotorflight_start(seen, state, settings)

        def loop(seen, state, settings):
            if seen.time > 0.0:  # not where gains are sought
                wave = np.sin(speed * seen.time + math.pi * np.array([0.0, 0.5, 0.25]))
                more = np.radians(TURNED[1] * wave + TURNED[0] * rng.standard_normal(3))
                seen = seen._replace(p=seen.p + more[0], q=seen.q + more[1], r=seen.r + more[2])
            numbers, servos = logged_loop(seen, state, settings)
            rows.append((*seen, *numbers))
            return servos

        self.controller = hs.Controller(
            loop, reset=begin, states=kernel.COUNT, settings=settings, name=law.name
        )


def fly(vehicle, law, *, seed=0, duration=120.0, **mission):
    """Return a trajectory of everyday flying, and the loops' numbers, (n_loop, n)."""
    logging = Logging(law, vehicle, seed)
    mission, weather = Everyday(duration=duration, **mission), hs.Weather(turbulence="light")
    goes_on = hs.FlightEnvelope(saturation=None)  # as pilots do while a tail is at its end
    plan = hs.FlightPlan(mission=mission, weather=weather, envelope=goes_on)
    flown = vehicle.with_controller(logging.controller)
    (flight,) = simulate(flown, plan, keep_ended=True, seed=seed)
    return flight, np.array(logging.rows)[: len(flight.time)]


def columns(vehicle, law, flight, loops):
    """Return the columns of a log of Rotorflight 4.6, of each loop: name -> integers.

    The mixer's limits, within which it logs its inputs, are the ends of the tail's linkage.
    """
    seen, own = dict(zip(hs.Seen._fields, loops.T)), loops[:, len(hs.Seen._fields) :]
    forces = np.array([seen["ax"], -seen["ay"], -seen["az"]]) / 9.80665
    forces += SHAKEN[0] * np.random.default_rng(len(loops)).standard_normal(forces.shape)
    forces += SHAKEN[1] * np.sin(vehicle.parameters["main_rotor.speed"] * seen["time"])
    low_pass = bessel(2, ACC_LPF, norm="mag", fs=1.0 / np.median(np.diff(seen["time"])))
    forces = forces[:, :1] + lfilter(*low_pass, forces - forces[:, :1])
    wanted, gyro, terms, mixer, ahead = np.split(own, [4, 7, 25, 29], axis=1)
    ends = np.outer([-0.5, 0.5], law.yaw.range) - law.yaw.centre
    mixer = np.column_stack([*mixer.T[:2], np.clip(mixer[:, 2], *ends / TAIL_PITCH), mixer[:, 3]])
    terms = terms.reshape(-1, 3, 6)
    terms[:, 2, 3] += ahead[:, 0]  # in yaw's F
    sticks = np.array([2.0 * seen["LAT"], -2.0 * seen["LON"], 2.0 * seen["PED"]])
    pitch = math.degrees(law.collective.centre) / 12.0 + wanted[:, 3]
    speed = 30.0 / math.pi * np.interp(seen["time"], flight.time, flight.rotor[:, 4])
    turned = np.degrees([seen["phi"], -seen["theta"], np.mod(seen["psi"], 2.0 * math.pi)])
    rates = np.degrees([seen["p"], -seen["q"], -seen["r"]])
    roll, nose, yaw, col = mixer.T
    gains = {name: [getattr(law.roll, name), getattr(law.pitch, name)] for name in "bo"}
    kept = "PIDF" + "B" * (max(*gains["b"], law.yaw.b) > 0.0) + "O" * (max(gains["o"]) > 0.0)
    sides = (0.5 * col + side * math.sqrt(0.75) * roll + 0.5 * nose for side in (1.0, -1.0))
    logged = {
        "time": SINCE_START + 1e6 * seen["time"],
        "rcCommand": [*(500.0 * sticks), 500.0 * pitch, np.full(len(own), 700.0)],
        "setpoint": [*wanted[:, :3].T, 1e3 * pitch],
        "mixer": 1e3 * mixer.T,
        **{f"axis{one}": 1e3 * terms[:, :, "PIDFBO".index(one)].T for one in kept},
        "attitude": 10.0 * turned,
        "gyroRAW": rates,
        "gyroADC": gyro.T,
        "accADC": ACC_1G * forces,
        "headspeed": vehicle.parameters["main_rotor.speed"] * speed,
        "tailspeed": vehicle.parameters["tail_rotor.speed"] * speed,
        "servo": [1500.0 + 125.0 * one for one in (0.5 * col - nose, *sides, yaw)],
    }
    flat = {}
    for name, values in logged.items():
        several = {f"{name}[{k}]": one for k, one in enumerate(values)}
        flat |= {name: values} if np.ndim(values) == 1 else several
    return {name: np.rint(values).astype(np.int64) for name, values in flat.items()}


def header(law, period):
    """Return the header's lines of a log of each loop, a period, s, apart."""
    yaw, axes = law.yaw, (law.roll, law.pitch, law.yaw)
    lines = {
        **{"Firmware type": "Rotorflight", "Craft name": law.name},
        "Firmware revision": "Rotorflight 4.6.0 (b92aac0) STM32F7X2",
        **{"I interval": 16, "P interval": 1, "P ratio": 16},
        **{"gyro_scale": "0x3f800000", "acc_1G": ACC_1G, "looptime": LOOPTIME},
        "acc_lpf_hz": 100.0 * ACC_LPF,
        "pid_process_denom": round(1e6 * period / LOOPTIME),
        "filter_process_denom": round(1e6 * period / LOOPTIME),
        "error_limit": [one.error_limit for one in axes],
        "error_decay": (law.roll.error_decay_time, law.roll.error_decay_limit),
        "iterm_relax_type": 2 if yaw.relax_level else 0,
        "iterm_relax_cutoff": [one.relax_cutoff for one in axes],
        "cyclic_coupling": (law.cyclic_cross_coupling_gain, 0, law.cyclic_cross_coupling_cutoff),
        "yaw_stop_gain": (yaw.cw_stop_gain, yaw.ccw_stop_gain),
        "yaw_precomp": (yaw.precomp_cutoff, yaw.cyclic_ff_gain, yaw.collective_ff_gain),
        "yaw_inertia_precomp": (0, 25),
        "hsi_gain": (law.roll.o, law.pitch.o),
        "hsi_limit": (law.roll.offset_limit, law.pitch.offset_limit),
        "pitch_compensation": 0,
        **{"gyro_lpf1_type": 1, "gyro_lpf1_static_hz": law.gyro_lowpass},
        **{"gyro_lpf2_type": 0, "gyro_lpf2_static_hz": 0},
        "gyro_notch_hz": [one.frequency for one in law.notches[:2]] or (0, 0),
        "gyro_notch_cutoff": [_lower(one) for one in law.notches[:2]] or (0, 0),
        "collectiveRange": (-law.collective.limit, law.collective.limit),
    }
    for name, one in zip(("roll", "pitch", "yaw"), axes):
        lines[f"{name}PID"] = one.p, one.i, one.d, one.f, one.b
        lines[f"{name}BW"] = one.gyro_cutoff, one.d_cutoff, one.b_cutoff
    return {
        name: value if isinstance(value, str) else ",".join(f"{round(x)}" for x in np.ravel(value))
        for name, value in lines.items()
    }


def _lower(notch):
    """Return where a notch's band begins, Hz: Q = f0 f1 / (f0^2 - f1^2)."""
    half = 0.5 / notch.q
    return notch.frequency * (math.sqrt(1.0 + half**2) - half)
