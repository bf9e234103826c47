"""A first look at logs of which nothing is known: of ArduPilot, of PX4, and of anyone."""

import json
import shlex
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

import autopilot_logs
from command import said
from helisim.base.errors import InputError
from helisim.base.note import Option
from helisim.base.units import RAD_PER_DEG
from helisim.cli import main
from helisim.cli.logs import command_line
from helisim.ident import load_fit
from helisim.logs import Clock, Column
from helisim.logs.examples import examples
from helisim.logs.report import OURS, LogFinding  # noqa: F401  (rows name it)
from helisim.logs.timing import Options  # noqa: F401  (rows name it)
from helisim.look import look
from helisim.look.channels import guess  # noqa: F401  (rows name it)
from helisim.look.excitation import FoundAnswer, FoundExcitation, answers, joined, whole  # noqa: F401  (rows name them)
from helisim.look.look import _band, _choices, _event, _instead, _main  # noqa: F401  (rows name them)
from helisim.look.opened import LogLook, _mended  # noqa: F401  (rows name it)
from helisim.records.record import CHANNELS, FlightRecord
from tabled import tabled

DAMPING, GAIN, DELAY = 6.0, 90.0, 0.04
"""Of the roll that is flown: p/lat = 90 e^(-0.04 s) / (s + 6)."""


def command(found):
    return "" if found.proposal is None else command_line(found.proposal)


@cache
def rolled(duration=60.0, fine=1000.0, seed=0):
    """Return time, lateral control, p and phi of a sweep from 0.5 to 25 rad/s, exactly."""
    t = np.arange(int(duration * fine)) / fine
    inside = np.clip((t - 5.0) / (duration - 10.0), 0.0, 1.0)
    phase = 0.5 * (duration - 10.0) / np.log(50.0) * (50.0**inside - 1.0)
    moving = (t >= 5.0) & (t <= duration - 5.0)
    lat = np.where(moving, 0.1 * np.sin(phase), 0.0)
    lat += 0.002 * np.random.default_rng(seed).standard_normal(t.size // 20).repeat(20)
    late = np.interp(t - DELAY, t, lat)
    decay = np.exp(-DAMPING / fine)
    p = lfilter([0.0, (1.0 - decay) * GAIN / DAMPING], [1.0, -decay], late)
    return t, lat, p, np.cumsum(p) / fine


@pytest.mark.parametrize(("low", "told"), [(0.1234, 0.13), (2.0, 2.0), (3.41, 3.5), (10.2, 11.0)])
def test_a_proposed_band_begins_two_digits_above_where_all_is_coherent(low, told):
    rows = [("lat", "p", low, 30.0), ("LAT", "p", 0.1, 35.0), ("lat", "q", 0.05, 50.0)]
    rows = [SimpleNamespace(**dict(zip(("input", "output", "low", "high"), row))) for row in rows]
    one = SimpleNamespace(answers=rows, durations=[600.0])
    assert _band([one], ["lat"], ["p"], joint=False) == (told, 35.0)
    assert _band([one], ["lat"], ["p"], joint=True) == (0.1, 35.0)  # the stick's own


def sampled(rate, jitter, seed, *columns):
    t, random = rolled()[0], np.random.default_rng(seed)
    count = int(t[-1] * rate) - 1
    at = (np.arange(1, count) + jitter * random.uniform(-0.5, 0.5, count - 1)) / rate
    stamps = np.round(1e6 * at) + 12_000_000
    return stamps, [np.interp(np.round(1e6 * at) / 1e6, t, column) for column in columns]


def ardupilot(path):
    """Write a log with rates and outputs at 100 Hz, attitude at 25, pulses at 20, with jitter."""
    _, lat, p, phi = rolled()
    random = np.random.default_rng(1)
    rates, (own, out) = sampled(100.0, 0.2, 2, p, lat)
    own = own / RAD_PER_DEG + 0.1 * random.standard_normal(own.size)
    attitude, (angle,) = sampled(25.0, 0.2, 3, phi)
    pulses, (stick,) = sampled(20.0, 0.2, 4, lat)
    still = 0.01 * random.standard_normal(own.size)
    messages = {
        "RATE": (rates, {"RDes": own, "R": own, "ROut": out, "PDes": still, "P": still}),
        "ATT": (attitude, {"DesRoll": angle, "Roll": angle / RAD_PER_DEG}),
        "RCIN": (pulses, {"C1": 1500 + 800 * stick, "C2": 1500.0 + 0.0 * stick}),
    }
    path.write_bytes(autopilot_logs.dataflash(messages))
    return path


def anyones(path, *, gap=False):
    stamps, (own, out, angle) = sampled(50.0, 0.1, 9, *rolled()[2:0:-1], rolled()[3])
    rate, bank = own / RAD_PER_DEG, angle / RAD_PER_DEG
    time = np.round(stamps * 1e-3, 1)
    table = np.column_stack([np.arange(stamps.size), time, rate, bank, 100.0 * out])
    table = np.delete(table, np.s_[100:150], axis=0) if gap else table
    header = "row;time_ms;rollRate;Roll;aileron"
    np.savetxt(path, table, delimiter=";", header=header, comments="", fmt="%.10g")
    return path


def runs(found, folder):
    words = shlex.split(command(found))
    assert words[:2] == ["helisim", "identify"]
    out = folder / "model.json"
    assert main([*words[1:], "--json", str(out), "--quiet"]) == 0
    return load_fit(out)


def same_response(fit, frequency, *, tolerance):
    true = GAIN * np.exp(-1j * frequency * DELAY) / (1j * frequency + DAMPING)
    found = complex(np.ravel(fit.response([frequency]).response)[0])
    assert abs(found / true - 1.0) < tolerance, (found, true)


def test_a_log_of_ardupilot(tmp_path, capsys):
    found = look(ardupilot(tmp_path / "a.bin"))
    (log,) = found.logs
    columns = {one.name: (one.column.column, one.column.unit) for one in log.channels}
    assert (columns["p"], columns["lat"]) == (("RATE.R", "deg/s"), ("RATE.ROut", "1"))
    assert (columns["phi"], columns["LAT"]) == (("ATT.Roll", "deg"), ("RCIN.C1", "us"))
    rates = {one.name.split("'")[0]: one.rate for one in log.clocks}
    assert rates == pytest.approx({"RATE": 100.0, "ATT": 25.0, "RCIN": 20.0})
    assert {one.even for one in log.clocks} == {"jitter"}
    swept = {one.channel: one for one in log.excitations}
    assert {one.kind for one in swept.values()} == {"sweep"}
    # from 5 to 55 s, less the first stamp, to the sweep's slow first wave; 0.5 to 25 rad/s
    assert swept["lat"].start == pytest.approx(5.0, abs=1.0)
    assert swept["lat"].stop == pytest.approx(55.0, abs=0.5)
    assert swept["lat"].low < 1.0
    assert swept["lat"].high == pytest.approx(25.0, rel=0.1)
    assert swept["lat"].amplitude == pytest.approx(0.1, rel=0.05)
    assert (log.answers[0].input, log.answers[0].output) == ("lat", "p")
    assert not {"unit", "sign", "axes", "loop"} & {finding.kind for finding in log.findings}
    fit = runs(found, tmp_path)
    for frequency in (3.0, 10.0):  # within the fit's error, and 2 % of jitter's interpolation
        same_response(fit, frequency, tolerance=0.03)
    assert "resampled to 100 Hz" in capsys.readouterr().out


def test_what_is_given_is_taken_and_doubted_and_nothing_to_identify_is_said(tmp_path, capsys):
    path = anyones(tmp_path / "a.csv")
    found = look(path, channels={"p": Column("rollRate", "rad/s")})
    given = {one.name: one.why == "given" for one in found.logs[0].channels}
    assert given == {"p": True, "phi": False, "lat": False}
    doubted = [said(one) for one in found.logs[0].findings if one.kind == "unit"]
    assert doubted == ["--channel p=rollRate:deg/s"]
    assert "!: " in str(found)
    found = look(anyones(tmp_path / "a.csv"), time=Clock("time_ms", "s"))
    (finding,) = (one for one in found.logs[0].findings if one.kind == "unit of time")
    assert "its steps are 20 s" in finding.text
    assert said(finding) == "--time time_ms:ms"
    assert found.proposal is None
    t, random, path = np.arange(3000) / 50.0, np.random.default_rng(0), tmp_path / "rest.csv"
    for width, why in ((0.0, "no control moves"), (1.0, "moved in one event")):
        table = [t, *random.standard_normal((2, 3000)) * [t > -1.0, np.abs(t - 30.0) < width]]
        np.savetxt(path, np.transpose(table), "%g", ",", header="t [s],p [rad/s],lat", comments="")
        assert main(["look", str(path)]) == 1
        printed = capsys.readouterr().out
        assert all(one in printed for one in (why, "nothing can be identified"))
    with pytest.raises(InputError, match="no logs"):
        look([])


@tabled("names", "structure")
def test_the_command_for_example_logs_works(names, structure, tmp_path, capsys):
    paths = [str(examples()[name].path) for name in names]
    assert main(["look", *paths, "--json", str(tmp_path / "look.json")]) == 0
    printed = capsys.readouterr().out
    command = printed.splitlines()[printed.splitlines().index("run next:") + 1]
    assert f"--structure {structure}" in command
    data = json.loads((tmp_path / "look.json").read_text())
    assert data["command"] == command
    for log, name in zip(data["logs"], names):
        axis = name.removeprefix("sweep_") if name != "logger" else "lat"
        assert {one["channel"].lower() for one in log["excitations"]} == {axis}
    assert main(shlex.split(command)[1:]) == 0


def test_a_closed_loop_is_told_and_nothing_is_proposed_that_identify_refuses(tmp_path):
    t, random = np.arange(0.0, 80.0, 0.01), np.random.default_rng(0)
    inside = np.clip((t - 5.0) / 70.0, 0.0, 1.0)
    stick = 0.1 * np.sin(35.0 / np.log(40.0) * (40.0**inside - 1.0)) * ((t > 5.0) & (t < 75.0))
    for gust in (8.0, 0.0, 100.0):  # the last drowns what the stick does
        push = gust * random.standard_normal(t.size)
        # dp/dt = -2 p + 60 (stick - 0.08 p) + push
        p = lfilter([0.0, 0.01], [1.0, -1.0 + 0.01 * (2.0 + 4.8)], 60.0 * stick + push)
        columns = np.column_stack([t, stick, stick - 0.08 * p, p])
        path = tmp_path / f"gust{gust:g}.csv"
        header = "t [s],LAT [1],lat [1],p [rad/s]"
        np.savetxt(path, columns, delimiter=",", header=header, comments="")
        found = look(path)
        options = [said(one) for one in found.logs[0].findings if one.kind == "loop"]
        assert options == (["--reference LAT"] if gust else [])
        # logged as fast as the command, in any case
        assert ("--reference LAT" in command(found)) == (found.proposal is not None) == (gust < 9.0)
        told = ("p over lat gives no model: no response", "fly instead a sweep of lat")
        assert all((one in str(found)) == (gust > 9.0) for one in told)


@pytest.mark.parametrize("swept", [0.0, 0.1])
def test_a_command_that_only_a_controller_moves_shows_no_vehicle(tmp_path, swept, capsys):
    """Gusts in a loop without a pilot: p over lat is minus one over the law, which leads."""
    random, count = np.random.default_rng(2).standard_normal((2, 9000)), 9000
    stick = np.pad(swept * rolled()[1][::10] / 0.1, (0, count))[:count]
    p, lat = np.zeros(count), np.zeros(count)
    for k in range(count - 1):
        seen = p[k] + 0.01 * random[1, k]
        lat[k + 1] = 0.6 * lat[k] + 0.4 * (stick[k] - 0.05 * seen)
        p[k + 1] = p[k] + 0.01 * (GAIN * lat[k] - DAMPING * p[k] + 4.0 * random[0, k])
    rows = {"R": p / RAD_PER_DEG, "ROut": lat, "AOut": 0.5 * (np.arange(count) // 1000 == 2)}
    path = tmp_path / "a.bin"
    path.write_bytes(autopilot_logs.dataflash({"RATE": (1e4 * np.arange(count) + 1e6, rows)}))
    found = look(path)
    assert ("lat moved as a controller's command does" in str(found)) == (not swept)
    assert (found.proposal is None) == (not swept)
    words = ["--structure", "tf:0/1", "--inputs", "lat", "--outputs", "p", "--band", "3", "60"]
    words += ["--channel", "lat=RATE.ROut:1", "--channel", "p=RATE.R:deg/s", "--quiet"]
    assert main(["identify", str(path), *words]) in (1, 3)
    said = "feedback" if swept else "opposes it, as what a controller answers"
    assert said in " ".join(capsys.readouterr().out.split())


def named(path, control, rate, scale=1.0):
    _, lat, p, phi = rolled()
    stamps, columns = sampled(50.0, 0.0, 3, lat, scale * p, phi / RAD_PER_DEG)
    header = f"time_us,{control},{rate},bank"
    np.savetxt(path, np.column_stack([stamps, *columns]), delimiter=",", header=header, comments="")
    return path


def test_names_are_known_asked_for_or_doubted(tmp_path, capsys):
    """Of a doubtful sign, rate's or bank's, one can't know which: the command can't mend it."""
    found = look(named(tmp_path / "a.csv", "rudder_cmd", "yaw_rate"))
    assert [one.channel for one in found.logs[0].excitations] == ["ped"]
    assert dict(found.proposal.options)["structure"] == ("tf:0/1",)  # of no helicopter
    assert not any("resample" in one.name for one in found.logs[0].options)  # of one even clock
    assert not any(one in str(found) for one in ("not used", " parts"))
    assert main(["look", str(named(tmp_path / "b.csv", "foo", "roll_rate"))]) == 1
    assert "--channel lat=COLUMN:percent" in " ".join(capsys.readouterr().out.split())
    found = look(named(tmp_path / "a.csv", "ail_cmd", "p_rad_s", scale=1.0 / RAD_PER_DEG))
    doubted = [said(one) for one in found.logs[0].findings if one.kind == "unit"]
    assert doubted == ["--channel p=p_rad_s:deg/s"]
    assert main(["look", str(named(tmp_path / "a.csv", "ail_cmd", "roll_rate", scale=-1.0))]) == 0
    assert "settle first" in capsys.readouterr().out
    assert main(["look", str(named(tmp_path / "b.csv", "ail_cmd", "roll_rate"))]) == 0
    assert "settle first" not in capsys.readouterr().out


def flown(
    path, *, lat=1.0, heading="time,aileron,gyro_x,thrust,rc_aileron", of=60.0, delimiter=","
):
    t, own, p, _ = rolled()
    rows = slice(0, int(of * 1000), 20)
    still = np.full(t[rows].size, 3.0)
    columns = [t[rows], 100.0 * lat * own[rows], lat * p[rows] / RAD_PER_DEG, 9.0 * still, still]
    np.savetxt(path, np.column_stack(columns), delimiter=delimiter, header=heading, comments="")
    return path


def test_the_order_is_one_that_identify_sees(tmp_path):
    """A gain and a delay, as of a rate over the stick that commands it."""
    t, own, *_ = rolled()
    table = np.column_stack([t, own, 5.0 * np.roll(own, 40)])[::20]
    header = "t [s],LAT [1],p [rad/s]"
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=header, comments="")
    fit = runs(look(tmp_path / "a.csv"), tmp_path)
    assert (fit.structure.name, fit.degenerate) == ("p_over_LAT", ())
    assert (fit["b0"].value, fit["tau"].value) == pytest.approx((5.0, 0.04), rel=0.01)


def test_one_event_of_a_long_log_is_coherent_with_all_and_shows_nothing():
    random, t = np.random.default_rng(3), np.arange(4000) / 50.0
    event = np.exp(-((t - 30.0) ** 2)) * np.sin(4.0 * t)
    noise = 1e-4 * random.standard_normal((2, t.size))
    own, answer = event + noise[0], np.exp(-((t - 30.3) ** 2)) * np.cos(5.0 * t) + noise[1]
    channels = tuple(CHANNELS[name] for name in ("lat", "p"))
    record = FlightRecord(t, np.column_stack([own, answer]), channels, {})
    assert not answers(record, [whole(record, "lat")], {})


@pytest.mark.parametrize(("later", "cut"), [(0.0, True), (0.25, True), (1.0, False)])
def test_a_control_that_moves_as_much_again_moved_in_no_event_alone(tmp_path, later, cut):
    t, pulses = np.arange(4000) / 50.0, (1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0)
    own = np.zeros(t.size)
    for start, size in ((500, 1.0), (1800, later), (3100, later)):
        own[start : start + 140] = 0.1 * size * np.repeat(pulses, 20)
    p = lfilter([0.3], [1.0, -np.exp(-0.08)], own)
    p += 0.02 * np.random.default_rng(0).standard_normal(t.size)
    table = np.column_stack([t, own, p])
    header = "t [s],lat [1],p [rad/s]"
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=header, comments="")
    assert ("--from" in command(look(tmp_path / "a.csv"))) == cut


@tabled("heading", "unit", "rate")
def test_headings_of_many_hands_are_understood(tmp_path, heading, unit, rate):
    found = look(flown(tmp_path / "a.csv", heading=heading))
    units = {one.name: one.column.unit for one in found.logs[0].channels}
    assert (units, found.proposal.command) == ({"lat": unit, "p": rate}, "identify")


def moved(channel, start=10.0, stop=20.0, kind="doublet", amplitude=1.0):
    return FoundExcitation(channel, kind, start, stop, 1.0, 10.0, amplitude)


def alone(one, *others):
    """Return what is said of an event, behind a colon, and its limits."""
    said = _event(one, others)
    return said.text.partition(": ")[2], *(float(limit.value) for limit in said.remedy)


def answered(input_, output, coherence=0.9):
    return FoundAnswer(input_, output, 1.0, 10.0, coherence, f"tf:{output}")


def chosen(*found, heading="cyclic", log_format="CSV"):
    """Return structure and outputs of each choice for logs of these answers."""
    seen = [SimpleNamespace(column=SimpleNamespace(column=heading))]
    log = SimpleNamespace(answers=found, format=log_format, channels=seen)
    return [(structure, *outputs) for structure, _, outputs in _choices([log])]


def a_log(*seconds, **told):
    """Return a look at a log whose parts last so many seconds."""
    parts = [FlightRecord([0.0, one], np.zeros((2, 1)), (CHANNELS["p"],), {}) for one in seconds]
    return LogLook("a.csv", "CSV", records=tuple(parts), **told)


def finding(*options, **told):
    return LogFinding("gap", "t", tuple(Option(*one.split("=")) for one in options), **told)


@tabled("made", "wanted")
def test_what_is_told_and_proposed_by_hand(made, wanted):
    assert made() == wanted
