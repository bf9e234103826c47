"""Coverage-guided fuzzing of everything that reads what somebody else wrote.

    pip install atheris                            # libFuzzer; it has wheels for some Pythons only
    python tests/fuzz/fuzz_readers.py --seconds 60 # all readers, one after the other
    python tests/fuzz/fuzz_readers.py --only log --seconds 600

A reader may return, or raise a `HelisimError`; whatever else it raises is a defect, whose input is
kept in the folder --keep. The inputs start from sound files of each kind (`seeds`), so that the
mutations reach what lies behind the first check. Exit status 1: a defect was found.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

try:
    import atheris
except ImportError:
    sys.exit("fuzz_readers: needs atheris: pip install atheris")

READING = ("logs", "storage", "record", "ident", "output", "repeat", "comparison", "vehicle")
"""Parts of helisim whose coverage guides the fuzzer."""

with atheris.instrument_imports(include=[f"helisim.{part}" for part in READING]):
    import numpy as np

    from helisim.base.errors import HelisimError, InputError
    from helisim.ident import Structure, frequency_response, load_fit, load_response, structures
    from helisim.ident.expression import Expression
    from helisim.logs import REPAIRS, Clock, Column, Map, read_log
    from helisim.logs.mapping import MAP_EXAMPLE
    from helisim.records.channels import channel
    from helisim.records.record import FlightRecord
    from helisim.records.storage import read_record, write_record
    from helisim.study.replay import arguments_of
    from helisim.study.results import read_models, read_run
    from helisim.vehicle import read_parameters
    from helisim.vehicle.folder import model_folder

MAP = Map(
    {"p": Column("p", "deg/s"), "lat": Column("u", "us", trim=1500, range=800)}, Clock("t", "s")
)


def _log(path: Path) -> None:
    repair = sorted(set(REPAIRS) - {"resets"})
    for channels, options in ((MAP, {"repair": repair}), (None, {"resample_hz": 50.0})):
        try:
            log = read_log(path, channels=channels, **options)
        except HelisimError:
            continue
        for record in log.records:
            assert np.all(np.isfinite(record.values)), "a record isn't finite"


def _expression(path: Path) -> None:
    expression = Expression(path.read_bytes().decode("utf-8", "replace"))
    expression.evaluate(dict.fromkeys(expression.names, 0.5))


def _structure(path: Path) -> None:
    structure = Structure.from_toml(path)
    assert Structure.from_dict(structure.to_dict()).to_dict() == structure.to_dict()


def _response(path: Path) -> None:
    found = load_response(path, unnamed="p/lat")
    json.dumps(found.to_dict(), allow_nan=False)
    if found.scatter is not None:
        found.scatter.variance([0], [0], [0])


def _fit(path: Path) -> None:
    fit = load_fit(path)
    json.dumps(fit.to_dict(), allow_nan=False)
    str(fit)


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "log": ("log.bin", _log),
    "parquet": ("record.parquet", read_record),
    "csv": ("record.csv", read_record),
    "map": ("map.toml", Map.from_toml),
    "structure": ("structure.toml", _structure),
    "parameters": ("parameters.toml", read_parameters),
    "expression": ("expression.txt", _expression),
    "fit": ("fit.json", _fit),
    "fits": ("fits.json", read_models),
    "response": ("response.json", _response),
    "columns": ("columns.txt", _response),
    "run": ("results.json", lambda path: (arguments_of(path.parent), read_run(path.parent))),
}
"""Reader -> the name of the file that it is given, and the call."""


def seeds(name: str, folder: Path) -> list[bytes]:
    """Return sound files of a reader's kind."""
    record = FlightRecord(
        0.01 * np.arange(8), np.ones((8, 2)).cumsum(axis=0), (channel("lat"), channel("p"))
    )
    own = [write_record(record, folder / f"seed.{end}").read_bytes() for end in ("parquet", "csv")]
    foreign = b"t [s],p [deg/s],u\n" + b"".join(b"%d.0,%d,1500\n" % (k, k) for k in range(9))
    heave = structures.heave.to_dict()
    arguments = {"flights": 1, "seed": 1, "parameters": {}, "timestep": None, "rotor": False}
    row = {"name": "Z_w", "unit": "1/s", "identified": -1.0}
    table = {"name": "heave", "input": "IN1", "cost": 1.0, "band_rad_s": [1.0, 2.0]}
    run = {"configuration": {"arguments": arguments}, "tables": [{**table, "parameters": [row]}]}
    moved = FlightRecord(
        0.05 * np.arange(200), np.random.default_rng(1).normal(size=(200, 2)), record.channels
    )
    found = frequency_response(moved, inputs="lat", outputs="p", band=(5.0, 20.0), windows=2.0)
    for end in ("json", "csv"):
        found.save(folder / f"response.{end}")
    sound = {
        "log": [foreign, foreign.replace(b",", b";"), b"ULog\x01\x12\x35\x01", b"\xa3\x95", *own],
        "parquet": own[:1],
        "csv": own[1:],
        "map": [MAP_EXAMPLE.encode()],
        "structure": [structures.heave.to_toml().encode()],
        "parameters": [(model_folder("jr700") / "tuned.toml").read_bytes()],
        "expression": [b"-tau_f * sqrt(N_v) ** 2 + exp(-1.5e3)"],
        "fit": [json.dumps({"format": "helisim fit, version 1", "structure": heave}).encode()],
        "response": [(folder / "response.json").read_bytes()],
        "columns": [
            (folder / "response.csv").read_bytes(),
            b"% f_Hz mag_dB phase_deg\n1 2 3\n2 1 9\n",
        ],
        "fits": [b'{"format": "helisim fits, version 1", "models": [{"name": "heave"}]}'],
        "run": [json.dumps(run).encode()],
    }
    return sound[name]


def fuzz(name: str, seconds: int, keep: Path) -> None:
    """Fuzz one reader in this process, which libFuzzer ends."""
    folder = Path(tempfile.mkdtemp(prefix="helisim-fuzz-"))
    corpus = folder / "corpus"
    corpus.mkdir()
    for k, data in enumerate(seeds(name, folder)):
        (corpus / f"seed{k}").write_bytes(data)
    file, read = READERS[name]
    path = folder / file

    def once(data: bytes) -> None:
        path.write_bytes(data)
        try:
            read(path)
        except HelisimError as error:
            message = str(error)
            # An expression has no file; what it says is put behind the place by its structure.
            if not message or (name != "expression" and str(folder) not in message):
                raise InputError(f"the message doesn't name the file: {message}") from error

    options = [f"-max_total_time={seconds}", "-timeout=20", "-rss_limit_mb=4096", "-max_len=8192"]
    options += [f"-artifact_prefix={keep}/{name}-", "-print_final_stats=1"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], once)
    atheris.Fuzz()


def main() -> int:
    """Fuzz each reader in a process of its own, and print how many inputs it was given."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60, help="for each reader (default: 60)")
    parser.add_argument("--only", choices=READERS, help="one reader (default: all)")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-defects"), help="folder")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.keep.mkdir(parents=True, exist_ok=True)
    if options.here:
        fuzz(options.only, options.seconds, options.keep)
    defects = 0
    for name in [options.only] if options.only else READERS:
        command = [sys.executable, __file__, "--here", "--only", name]
        command += ["--seconds", str(options.seconds), "--keep", str(options.keep)]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        message = done.stdout + done.stderr
        count = re.search(r"number_of_executed_units:\s*(\d+)", message)
        reached = re.findall(r"cov: (\d+)", message)
        print(
            f"{name:<11} {int(count[1]) if count else 0:>9} inputs, "
            f"{reached[-1] if reached else 0} places reached",
            flush=True,
        )
        if done.returncode:
            defects += 1
            start = message.find("=== Uncaught Python exception")
            print(message[start if start >= 0 else -2000 :][:3000])
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
