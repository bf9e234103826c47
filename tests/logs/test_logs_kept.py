"""What is told of logs of every kind, whole, as it was reviewed: test_logs_kept.json."""

import numpy as np
import pytest
from test_blackbox import RAPID, moving  # noqa: F401  (rows name them)
from test_logs_several import MAP, P, faulty, jittery, spiked  # noqa: F401  (rows name them)
from test_readers import FORMATS, ulog  # noqa: F401  (rows name them)

import autopilot_logs  # noqa: F401  (rows name them)
from blackbox_logs import encode  # noqa: F401  (rows name them)
from helisim.base.errors import LogError
from helisim.logs import Clock, Column, Map, read_log, read_logs, screen  # noqa: F401  (rows name them)
from helisim.logs.blackbox import Blackbox  # noqa: F401  (rows name them)
from tabled import rows

SECONDS = Clock("t", "s")
CLOCKS = Map({"p": Column("gyro.xyz[0]", "rad/s"), "LAT": Column("stick.roll", "1")})
REPAIRS = ("missing", "gaps", "duplicates")
UNITS = Map({**MAP.channels, "q": Column("q", "rad/s")}, MAP.time)


def saved(to, data, name="a.log"):
    (to / name).write_bytes(data)
    return to / name


def gaps(to):
    path = jittery(to, 0.2)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:1000], *lines[1200:2000], *lines[2004:]]) + "\n")
    return path


READ = {
    **{
        one: lambda to, make=make, p=p: read_log(
            saved(to, make()), channels={"p": Column(p, "deg/s")}
        )
        for one, (make, p, *_) in FORMATS.items()
    },
    **dict(rows(globals(), "READ")),
}
T = np.arange(2000) / 100.0


@pytest.mark.parametrize("name", READ)
def test_a_log(name, tmp_path, kept):
    log = READ[name](tmp_path)
    told = [{**log.report.to_dict(), "digest": ""}, str(log.report), dict(log.headings)]
    told += [[one.name, one.unit] for one in log.records[0].channels]
    for one in log.records:
        told += [one.time[[0, -1]].tolist(), one.provenance.get("missing", {})]
        told.append(one.values[:: len(one) // 7].T.tolist())
    kept(told)


def test_what_is_refused(tmp_path, kept):
    said = []
    for path in (gaps(tmp_path), *faulty(tmp_path)):
        with pytest.raises(LogError) as raised:
            read_logs([path], channels=MAP if "jitter" not in path.name else P, time=SECONDS)
        said.append([[one.kind, one.text, str(one.remedy)] for one in raised.value.findings])
    kept([*said, str(raised.value)])
