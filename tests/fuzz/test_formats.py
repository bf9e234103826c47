"""Whatever stands in a file, its reader returns a value of numbers, or says shortly what is wrong.

By default some 40 mutations a format; `HELISIM_FUZZ=500` or `-m slow` runs 500 of each kind.
"""

import json
import math
import os
import random
import tomllib
import traceback
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np
import pyarrow.parquet as pq
import pytest

import helisim as hs
from autopilot_logs import ulog
from dataflash_logs import Log
from helisim.base.errors import HelisimError, LogError
from helisim.base.settings import toml_text
from helisim.logs import REPAIRS, Column
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record
from helisim.study.campaign import read_campaign
from helisim.study.replay import arguments_of
from helisim.study.results import read_models, read_run
from helisim.vehicle.folder import model_folder
from helisim.vehicle.parameters import read_parameters
from made_run import make_model, write_run

FEW, MANY = 40, 500
NASTY = (
    *(math.nan, math.inf, -math.inf, -1, 0, 1e-300, 1e300, 2**63, 10**30, 10**400, 0.5),
    *(None, True, False, "", "x", "nan", "inf", "off", "x" * 300, "\x1b[2J\nq", "../x", "ü" * 90),
    *([], {}, [[]], [{}], {"kind": {}}, {"kind": "x"}, [1.0], [math.nan, 1.0], {"x": {"y": [1]}}),
)
CAMPAIGN = {
    "campaign": {"replicates": 2, "flights": 2, "models": ["heave"], "identified_after": [2]},
    "set": {"sweep": {"duration": 60}},
    "vary": {"recorder": {"noise": {"values": [1, 4], "relative": True}}},
}


def settings_of(value):
    """Yield all numbers that a value holds."""
    if isinstance(value, float | np.floating):
        yield float(value)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
        yield from (float(np.sum(value)),)
    elif isinstance(value, Mapping):
        for one in value.values():
            yield from settings_of(one)
    elif isinstance(value, list | tuple):
        for one in value:
            yield from settings_of(one)
    elif is_dataclass(value):
        for one in fields(value):
            yield from settings_of(getattr(value, one.name))


def read_vehicle(path):
    """Read a parameter file; its name may be anything too."""
    return dict(read_parameters(path))


def read_a_run(path):
    """Read a run's results and what it was flown with."""
    arguments_of(path.parent)
    return read_run(path.parent).results.to_dict()


def read_a_log(path):
    """Read a log with all repairs that change no meaning."""
    repair = sorted(set(REPAIRS) - {"resets"})
    column = Column("IMU.GyrX" if path.suffix == ".bin" else "gyro.xyz", "rad/s")
    return [one.values for one in hs.read_log(path, channels={"p": column}, repair=repair).records]


READERS = {
    "record": ("record.parquet", hs.read_record),
    "csv": ("record.csv", hs.read_record),
    "fit": ("fit.json", hs.load_fit),
    "fits": ("fits.json", read_models),
    "response": ("response.json", hs.load_response),
    "run": ("results.json", read_a_run),
    "plan": ("plan.toml", hs.read_plan),
    "campaign": ("campaign.toml", read_campaign),
    "structure": ("structure.toml", hs.Structure.from_toml),
    "specs": ("specs.toml", hs.read_specs),
    "law": ("law.toml", hs.read_law),
    "vehicle": ("parameters.toml", read_vehicle),
    "dataflash": ("log.bin", read_a_log),
    "ulog": ("log.ulg", read_a_log),
}


@pytest.fixture(scope="module")
def sound(tmp_path_factory, jr700):
    """Return the folder of sound files, one of each format."""
    folder = tmp_path_factory.mktemp("sound")
    moved = np.random.default_rng(1).normal(size=(400, 2))
    flight = FlightRecord(0.05 * np.arange(400), moved, (channel("lat"), channel("p")), {"seed": 1})
    for name in ("record", "csv"):
        write_record(flight, folder / READERS[name][0])
    (folder / "fit.json").write_text(json.dumps(make_model("heave").fit.to_dict()))
    hs.frequency_response(flight, inputs="lat", outputs="p", band=(5.0, 20.0), windows=2.0).save(
        folder / "response.json"
    )
    write_run(folder)
    results = json.loads((folder / "results.json").read_text())
    arguments = {"flights": 1, "seed": 1, "parameters": {}, "timestep": None, "rotor": False}
    results["configuration"] = {"arguments": arguments}
    (folder / "results.json").write_text(json.dumps(results))
    plan = hs.FlightPlan(
        excitation=hs.Sequence(parts=(hs.Step(axis="lat"), hs.Chirp(axis="lon", band=(1.0, 9.0)))),
        weather=hs.Weather(gust=hs.Gust(north=1.0), turbulence="light"),
        ground=hs.Ground(deck=hs.Deck(heave=hs.Swing(amplitude=0.3))),
        faults=(hs.ServoStuck(servo="servo_tail", at=30.0), hs.SampleLoss(share=0.1)),
    )
    hs.write_plan(plan, folder / "plan.toml")
    (folder / "campaign.toml").write_text(toml_text(CAMPAIGN))
    (folder / "structure.toml").write_text(hs.structures.rollpitch.to_toml(), encoding="utf-8")
    hs.write_specs(hs.standard("margins", axes=("lat",)), folder / "specs.toml")
    hs.RateCommand.of(jr700).write(folder / "law.toml")
    text = (model_folder("jr700") / "tuned.toml").read_text(encoding="utf-8")
    (folder / "parameters.toml").write_text(text, encoding="utf-8")
    time = 4000 * np.arange(300)
    (folder / "log.ulg").write_bytes(ulog({"gyro": (time, {"xyz": np.sin(1e-6 * time)})}))
    log = Log()
    log.define(130, "IMU", "Qff", "TimeUS,GyrX,GyrY", units="sEE", multipliers="F00")
    for k in range(200):
        log.write(130, 2500 * k, math.sin(0.1 * k), 0.1)
    log.save(folder, "log.bin")
    return folder


def changed(data, random_):
    """Change plain data at one place: another value, a key renamed, one that is left out."""
    places = list(walk(data))
    holder, key = random_.choice(places)
    way = random_.random()
    if way < 0.75:
        holder[key] = random_.choice(NASTY)
    elif isinstance(holder, dict) and way < 0.9:
        holder[random_.choice(("x", "kind", "\x1b[2J", "y" * 300, f"{key}_"))] = holder.pop(key)
    else:
        del holder[key]
    return data


def walk(data):
    """Yield each place in plain data: what holds it, and its key or index."""
    for key, one in data.items() if isinstance(data, dict) else enumerate(data):
        yield data, key
        if isinstance(one, dict | list):
            yield from walk(one)


def spoiled(content, random_):
    """Change, cut out or repeat a few bytes."""
    data = bytearray(content)
    for _ in range(random_.randint(1, 4)):
        k = random_.randrange(len(data) + 1)
        way = random_.random()
        if way < 0.5 and k < len(data):
            data[k] = random_.choice((0, 255, 10, 44, 45, random_.randrange(256)))
        elif way < 0.8:
            del data[k : k + random_.randint(1, 60)]
        else:
            data[k:k] = random_.choice((b"nan", b"\x1b[2J", b"1e400", data[k : k + 40], b"\n,"))
        if not data:
            break
    return bytes(data)


def mutated(path, seed):
    """Return the bytes of a file that is changed: in its structure where it has one."""
    random_ = random.Random(f"{path.name} {seed}")
    content = path.read_bytes()
    if path.suffix == ".parquet" and seed % 2:
        return content, random_
    if seed % 4 == 3 or path.suffix not in (".json", ".toml"):
        return spoiled(content, random_), random_
    data = json.loads(content) if path.suffix == ".json" else tomllib.loads(content.decode())
    data = changed(data, random_)
    if path.suffix == ".json":
        return json.dumps(data).encode(), random_
    return toml_text(in_toml(data)).encode("utf-8", "replace"), random_


def in_toml(data):
    """Return plain data as TOML can have it: without null."""
    if isinstance(data, dict):
        return {str(key): in_toml(one) for key, one in data.items() if one is not None}
    if isinstance(data, list):
        return [in_toml(one) for one in data if one is not None]
    return data


def spoil_metadata(path, random_):
    """Change the JSON in a Parquet file's metadata."""
    table = pq.read_table(path)
    header = changed(json.loads(table.schema.metadata[b"helisim"]), random_)
    pq.write_table(table.replace_schema_metadata({b"helisim": json.dumps(header)}), path)


def attempt(name, sound, folder, seed):
    """Read one mutation; return what is wrong with the outcome, "" if nothing is."""
    file, read = READERS[name]
    for one in sound.iterdir():
        if name in ("run", "fits") and one.is_file():
            (folder / one.name).write_bytes(one.read_bytes())
    path = folder / file
    content, random_ = mutated(sound / file, seed)
    path.write_bytes(content)
    if path.suffix == ".parquet" and seed % 2:
        spoil_metadata(path, random_)
    try:
        value = read(path)
    except HelisimError as error:
        lines = str(error).splitlines() if isinstance(error, LogError) else [str(error)]
        if max(map(len, lines), default=0) > 500 or not all(one.isprintable() for one in lines):
            return f"message: {str(error)!r}"
        return "" if lines else "an empty message"
    except Exception as error:
        last = [
            one for one in traceback.extract_tb(error.__traceback__) if "helisim" in one.filename
        ]
        return f"{last[-1].filename}:{last[-1].lineno}: {error!r:.200}"
    return "NaN is taken" if any(one != one for one in settings_of(value)) else ""


def check(name, sound, folder, seeds):
    """Try mutations, and tell all that went wrong with their seeds."""
    found = {seed: said for seed in seeds if (said := attempt(name, sound, folder, seed))}
    distinct = dict.fromkeys(found.values())
    assert not found, "\n".join(
        [f"{len(found)} of {len(seeds)}, seed {next(iter(found))}", *distinct]
    )


@pytest.mark.parametrize("name", READERS)
def test_what_is_mutated_is_sound(name, sound):
    """Without a mutation each file is read."""
    file, read = READERS[name]
    assert read(sound / file) is not None


@pytest.mark.parametrize("name", READERS)
def test_a_spoiled_file_is_read_or_refused(name, sound, tmp_path):
    """Whatever a program or a person wrote into it: no other exception, and no NaN."""
    check(name, sound, tmp_path, range(int(os.environ.get("HELISIM_FUZZ", FEW))))


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_many_spoiled_files_are_read_or_refused(name, sound, tmp_path):
    """As before, 500 of structure and 500 of bytes."""
    check(name, sound, tmp_path, range(FEW, FEW + 2 * MANY))


@pytest.mark.parametrize("length", [300, 5000])
def test_a_long_name_is_no_traceback(length, capsys):
    """Of a vehicle, a structure, a plan and a record."""
    long = "n" * length
    for read in (hs.load, hs.read_plan, hs.Structure.from_toml, hs.load_fit, hs.read_specs):
        with pytest.raises(HelisimError) as caught:
            read(long)
        assert len(str(caught.value)) <= 500
