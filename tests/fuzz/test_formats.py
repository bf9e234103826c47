"""Whatever stands in a file, its reader returns a value of numbers, or says shortly what is wrong.

By default 24 mutations a format; `-m slow` runs 100 more.
"""

import json
import math
import random
import tomllib
import traceback
from functools import partial  # noqa: F401  (rows name them)

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import helisim as hs
from autopilot_logs import Log, ulog
from blackbox_logs import encode
from helisim.base.errors import HelisimError, LogError
from helisim.base.settings import to_plain, toml_text
from helisim.logs import REPAIRS, Column, DataFlash, Map  # noqa: F401  (rows name them)
from helisim.look.systemid import infer
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record
from helisim.study.campaign import read_campaign  # noqa: F401  (rows name them)
from helisim.study.results import read_models, read_run  # noqa: F401  (rows name them)
from helisim.vehicle.parameters import model_folder, read_parameters  # noqa: F401  (rows name them)
from made_run import make_model, write_run
from sid_logs import SidLog
from tabled import rows

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


def read_a_log(path, column="gyro", map_=None):
    repair = sorted(set(REPAIRS) - {"resets"})
    channels = map_ or {"p": Column(column, "rad/s")}
    return [one.values for one in hs.read_log(path, channels=channels, repair=repair).records]


def read_sweeps(path):
    return [record.values for log in infer(path).read() for record in log.records]


def read_all_messages(path):
    log = DataFlash(path)
    for table in (log.table(name, k) for name in log.types for k in log.instances(name)):
        assert all(len(table[field]) == len(table) for field in table.columns)
    assert all(map(len, (log.types, str(log.begins), str(log.messages()), f"{log.version} ")))
    return [*log.parameters().values(), read_a_log(path, "IMU.GyrX")]


READERS = dict(rows(globals(), "READERS"))


@pytest.fixture(scope="module")
def sound(tmp_path_factory, jr700):
    folder = tmp_path_factory.mktemp("sound")
    moved = np.random.default_rng(1).normal(size=(400, 2))
    flight = FlightRecord(0.05 * np.arange(400), moved, (channel("lat"), channel("p")), {"seed": 1})
    for name in ("record", "csv"):
        write_record(flight, folder / READERS[name][0])
    (folder / "fit.json").write_text(json.dumps(make_model("heave").fit.to_dict()))
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
    gyro = np.rint(100.0 * np.sin(1e-6 * time)).astype(int)
    fields = {f"gyroADC[{k}]": gyro for k in range(3)} | {f"axisP[{k}]": gyro for k in range(3)}
    (folder / "log.bbl").write_bytes(encode({"time": time, **fields}))
    log = Log()
    log.define(1, "IMU", "QBafH", "TimeUS,I,x,GyrX,n", units="s#-E-", multipliers="F--0-")
    log.define(2, "PARM", "QNf", "TimeUS,Name,Value")
    log.define(3, "MSG", "QZ", "TimeUS,Message")
    for k in range(100):
        log.write(1, 2500 * k, k % 2, *range(32), math.sin(0.1 * k), k)
        if k % 20 == 0:
            log.write(2, 2500 * k, b"P%d" % k, k)
            log.write(3, 2500 * k, b"ArduCopter V4.%d" % k)
    log.save(folder, "log.bin")
    SidLog().sweep(10, length=8.0, low=1.0).save(folder, "sweeps.bin")
    other = {"t [s]": 0.05 * np.arange(400), "gyro": moved[:, 0]}
    pq.write_table(pa.table(other), folder / "other.parquet")
    rows = zip(*(one.tolist() for one in other.values()))
    text = "t [s],gyro\n" + "".join(f"{t!r},{p!r}\n" for t, p in rows)
    (folder / "other.csv").write_text(text)
    tables = {"time": {"column": "t", "unit": "s"}, "file": {"delimiter": ","}}
    channel_p = {"column": "gyro", "unit": "us", "sign": -1, "trim": 0.1, "range": 2.0}
    (folder / "map.toml").write_text(toml_text(tables | {"channels": {"lat": channel_p}}))
    return folder


def changed(data, random_):
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
    for key, one in data.items() if isinstance(data, dict) else enumerate(data):
        yield data, key
        if isinstance(one, dict | list):
            yield from walk(one)


def spoiled(content, random_):
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
    random_ = random.Random(f"{path.name} {seed}")
    content = path.read_bytes()
    if path.name == "record.parquet" and seed % 2:
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
    table = pq.read_table(path)
    header = changed(json.loads(table.schema.metadata[b"helisim"]), random_)
    pq.write_table(table.replace_schema_metadata({b"helisim": json.dumps(header)}), path)


def attempt(name, sound, folder, seed):
    """Read one mutation; return what is wrong with the outcome, "" if nothing is."""
    file, read = READERS[name]
    for one in sound.iterdir():
        if name in ("run", "fits", "map") and one.is_file():
            (folder / one.name).write_bytes(one.read_bytes())
    path = folder / file
    content, random_ = mutated(sound / file, seed)
    path.write_bytes(content)
    if path.name == "record.parquet" and seed % 2:
        spoil_metadata(path, random_)
    try:
        value = read(path)
    except HelisimError as error:
        lines = str(error).splitlines() if isinstance(error, LogError) else [str(error)]
        if max(map(len, lines), default=0) > 500 or not all(one.isprintable() for one in lines):
            return f"message: {str(error)!r}"
        return "" if lines else "an empty message"
    except Exception as error:
        stack = traceback.extract_tb(error.__traceback__)
        last = [one for one in stack if "helisim" in one.filename][-1]
        return f"{last.filename}:{last.lineno}: {error!r:.200}"
    return "NaN is taken" if "NaN" in json.dumps(to_plain(value), default=str) else ""


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 124), marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", READERS)
def test_a_spoiled_file_is_read_or_refused(name, seeds, sound, tmp_path):
    file, read = READERS[name]
    assert read(sound / file) is not None
    found = {seed: said for seed in seeds if (said := attempt(name, sound, tmp_path, seed))}
    assert not found, f"{len(found)} of {len(seeds)}: {found}"


def test_a_long_name_is_no_traceback():
    long = "n" * 5000
    for read in (hs.load, hs.read_plan, hs.Structure.from_toml, hs.load_fit, hs.read_specs):
        with pytest.raises(HelisimError) as caught:
            read(long)
        assert len(str(caught.value)) <= 500
