"""Lock what helisim does: compare its output with that of a version before, to the last bit.

python scripts/proof/lock.py check [GROUP] [--fast]    print each difference, status 1 if any
python scripts/proof/lock.py accept GROUP [NAME ...]   rewrite the entries of a reviewed change

`commands` are the lines of lock.toml, of helisim and of scripts: their status, output and files;
`names` are the public ones with their signatures. Names of entries are as 'helisim fly *'; without
any all of the group are rewritten. --fast leaves out what takes long, --show prints differences
whole. What is locked is in `lock.json` beside this file.
"""

import difflib
import hashlib
import inspect
import io
import json
import os
import re
import runpy
import shlex
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from fnmatch import fnmatchcase
from functools import cache, partial
from pathlib import Path
from typing import Any

import common

import helisim as hs
from helisim import gym
from helisim.base.files import read_toml
from helisim.cli import main as command

FILE = Path(__file__).with_suffix(".json")
SCRIPTS = Path(__file__).parents[1]
_MODULES = ("blocks", "criteria", "laws", "missions", "structures", "sitl")
_UNSTABLE = ("versions", "made_by", "traceback", "source")
_TEXTS = (".toml", ".json", ".html", ".parm", ".svg", ".xml", ".md", ".csv", ".txt")
_ROOT = str(hs.model_folder("jr700").parents[1])
Case = Callable[[], Any]


def digest(*parts: bytes) -> str:
    total = hashlib.sha256()
    for part in parts:
        total.update(part)
    return total.hexdigest()[:16]


def run(words: list[str], folder: Path) -> dict[str, Any]:
    """Return what a command line does in a folder: status, output, files that it writes."""
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("default")
        try:
            status: Any = command(words[1:]) if words[0] == "helisim" else scripted(words[1:])
        except SystemExit as end:
            status = end.code
        except Exception as error:
            status = f"raised {type(error).__name__}: {error}"
    after = (path for path in sorted(folder.rglob("*")) if path.is_file())
    new = [path for path in after if before.get(path) != path.stat().st_mtime_ns]
    kept = [path for path in new if "__pycache__" not in path.parts]
    written = {str(path.relative_to(folder)): content(path, folder) for path in kept}
    found = {"status": status, "out": out.getvalue(), "err": err.getvalue(), "files": written}
    for name in ("out", "err"):
        found[name] = steady(found[name], folder).splitlines()
    return {name: one for name, one in found.items() if one or name == "status"}


def scripted(words: list[str]) -> int:
    """Run a script of this folder, or else of scripts/."""
    path = next(one for one in (Path(words[0]), SCRIPTS / words[0]) if one.is_file())
    before, sys.argv = sys.argv, words
    try:
        runpy.run_path(str(path), run_name="__main__")
    finally:
        sys.argv = before
    return 0


def content(path: Path, folder: Path) -> str:
    """Return a digest of what a file says, without the time and the place where it was made."""
    if path.suffix == ".parquet":
        try:
            record = hs.read_record(path)
        except Exception:
            return "there"
        facts = {name: one for name, one in record.provenance.items() if name not in _UNSTABLE}
        text = re.sub(r"\bhelisim(\.\w+)+:", "", json.dumps(facts, sort_keys=True))
        return digest(record.time.tobytes(), record.values.tobytes(), text.encode())
    if path.suffix not in _TEXTS:
        return "there"
    return digest(json.dumps(steady(path.read_text(encoding="utf-8"), folder)).encode())


def steady(text: str, folder: Path) -> str:
    text = text.replace(str(folder), "TMP").replace(_ROOT, "ROOT")
    text = text.replace(f"helisim {hs.__version__}", "helisim VERSION")
    text = re.sub(r'"versions": *\{[^}]*\}', '"versions": {}', text)
    text = re.sub(r"(?m)^\S+\.py:\d+: (\w*Warning)", r"\1", text)
    text = re.sub(r"(?m)^[^\n]*\d+ of \d+, \d+ s(, [^\n]*)?\n?", "", text)
    return re.sub(r"\bhelisim(\.\w+)+:", "", text)


def commands(*, fast: bool) -> dict[str, Case]:
    listed = read_toml(FILE.with_suffix(".toml"))
    written = [one for one in listed["lines"].splitlines() if one]
    lines = [one.removeprefix("! ") for one in written if not (fast and one[0] == "!")]

    @cache
    def all_of_them() -> list[dict[str, Any]]:
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made).resolve()
            for name, text in listed["files"].items():
                (folder / name).write_text(text, encoding="utf-8")
            os.environ["COLUMNS"] = "80"
            with chdir(folder):
                return [run(shlex.split(line), folder) for line in lines]

    named: dict[str, Case] = {}
    for n, line in enumerate(lines):
        again = lines[:n].count(line)
        named[f"{line} ({again + 1})" if again else line] = lambda n=n: all_of_them()[n]
    return named


def signature(value: Any) -> str:
    try:
        found = inspect.signature(value)
    except (TypeError, ValueError):
        return ""
    bare = [one.replace(annotation=one.empty) for one in found.parameters.values()]
    text = str(found.replace(parameters=bare, return_annotation=found.empty))
    return re.sub(r" at 0x[0-9a-f]+|\b(?:[a-z_]\w*\.)+(?=\w)", "", text)


def public(module: Any) -> list[str]:
    """Return the names that a module lists, or else those of helisim that it has."""
    own = {name: str(getattr(one, "__module__", "")) for name, one in vars(module).items()}
    found = [name for name, home in own.items() if name[0] != "_" and home.startswith("helisim")]
    return getattr(module, "__all__", found)


def names() -> dict[str, Case]:
    cases: dict[str, Case] = {"__all__": lambda: sorted(hs.__all__)}
    spaces = {"": hs, "gym.": gym, **{f"{n}.": getattr(hs, n) for n in _MODULES}}
    for space, module in spaces.items():
        listed = public(module)
        if space:
            cases[space + "__all__"] = lambda listed=listed: sorted(listed)
        for name in listed:
            if callable(value := getattr(module, name)):
                cases[space + name] = partial(signature, value)
    return cases


GROUPS = {"names": lambda **_: names(), "commands": commands}


def differences(found: Any, kept: Any) -> Iterator[str]:
    """Yield a line for each difference of two entries, texts line by line."""
    if not (isinstance(found, dict) and isinstance(kept, dict)):
        yield from () if found == kept else (f"{found!r}, locked {kept!r}",)
        return
    for name in sorted({*found, *kept}):
        pair = kept.get(name), found.get(name)
        if name in ("out", "err"):
            texts = (one or [] for one in pair)
            yield from difflib.unified_diff(*texts, "locked", name, n=1, lineterm="")
        elif pair[0] != pair[1]:
            yield f"{name}: {pair[1]!r}, locked {pair[0]!r}"


def check(group: str, locked: dict[str, Any], *, fast: bool, show: bool) -> int:
    """Print how a group differs from what is locked; return how many of its entries do."""
    cases, wrong = GROUPS[group](fast=fast), 0
    for name in [*cases, *(() if fast else sorted(set(locked) - set(cases)))]:
        found = cases[name]() if name in cases else "no such case"
        texts = list(differences(found, locked.get(name)))
        if len(texts) > 8 and not show:
            texts[8:] = [f"... {len(texts)} lines"]
        print(*(f"{group}: {name}: {text}\n" for text in texts), sep="", end="")
        wrong += bool(texts)
    print(f"{group}: {len(cases)} cases, {wrong} differ", flush=True)
    return wrong


def main(what: str, *words: str, fast: bool = False, show: bool = False) -> int:
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    if what == "check":
        found = [check(one, kept[one], fast=fast, show=show) for one in words or GROUPS]
        return int(sum(found) > 0)
    group, *named = words
    cases, old = GROUPS[group](fast=False), kept[group]
    asked = [name for name in cases if any(fnmatchcase(name, one) for one in named or "*")]
    new = old | {name: cases[name]() for name in asked}
    kept[group] = {name: new[name] for name in cases if name in new}
    FILE.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    print(f"{group}: {len(asked)} cases written", flush=True)
    return 0


if __name__ == "__main__":
    common.run(main)
