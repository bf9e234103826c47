"""Reads and writes files, atomically and up to a size."""

import errno
import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any

from helisim.base.errors import StorageError

SUFFIXES = (".parquet", ".csv")  # of flight records
MAX_BYTES = 2 << 30  # largest file
_TOML_BYTES = 1 << 20  # largest TOML file
_STEM_KEPT = 40  # characters of a file's name kept in its temporary's
_COUNT = count()  # for unique names of temporary files
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@contextmanager
def _said(path: str | PathLike[str], doing: str = "read") -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise StorageError(f"{path}: can't {doing} it: {reason}") from error


def read_bytes(path: str | PathLike[str], *, limit: int = MAX_BYTES) -> bytes:
    """Return a file's bytes. Raises StorageError, also beyond `limit`."""
    file_size(path, limit=limit)
    with _said(path):
        return Path(path).read_bytes()


def file_size(path: str | PathLike[str], *, limit: int = MAX_BYTES) -> int:
    """Return a regular file's size, bytes. Raises StorageError, also beyond `limit`."""
    path = Path(path)
    with _said(path):
        if not path.is_file():
            kinds = {
                "no such file": not path.exists(),
                f"a folder; expected a file, or all in it: {path}/*": path.is_dir(),
            }
            raise StorageError(f"{path}: {next(filter(kinds.get, kinds), 'not a regular file')}")
        size = path.stat().st_size
    if size > limit:
        raise StorageError(f"{path}: {size} bytes, and at most {limit} are read")
    return size


def first_bytes(path: str | PathLike[str], count: int) -> bytes:
    """Return up to `count` first bytes of a file. Raises StorageError."""
    file_size(path)
    with _said(path), Path(path).open("rb") as file:
        return file.read(count)


def pieces(path: str | PathLike[str], *, size: int = 1 << 20) -> Iterator[bytes]:
    """Yield a file's bytes, up to `size` at a time. Raises StorageError."""
    with _said(path), Path(path).open("rb") as file:
        while data := file.read(size):
            yield data


def read_text(path: str | PathLike[str], *, limit: int = MAX_BYTES) -> str:
    """Return a file's text, UTF-8 with or without a byte order mark. Raises StorageError."""
    try:
        text = read_bytes(path, limit=limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise StorageError(f"{path}: not text: {error.reason} at byte {error.start}") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_json(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a JSON object. Raises StorageError."""
    return parse_object(read_text(path), str(path))


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no number")


def parse_object(text: str | bytes, what: str) -> dict[str, Any]:
    """Return a JSON object from text. Raises StorageError, which begins with `what`."""
    try:
        data = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise StorageError(f"{what} is not JSON: {error}") from None
    if not isinstance(data, dict):
        raise StorageError(f"{what} is not a JSON object but a {type(data).__name__}")
    return data


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a TOML file. Raises StorageError."""
    text = read_text(path, limit=_TOML_BYTES)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise StorageError(f"{path}: not TOML: {error}") from None


def toml_key(name: str) -> str:
    """Return a name as a TOML key, bare if possible."""
    return name if _BARE_KEY.fullmatch(name) else toml_value(name)


def toml_value(item: object) -> str:
    """Return a number, a truth value, text, or a list of them as TOML."""
    match item:
        case bool():
            return str(item).lower()
        case int() | float():
            return repr(item)
        case list() | tuple():
            return f"[{', '.join(map(toml_value, item))}]"
    return json.dumps(str(item), ensure_ascii=False).replace("\x7f", "\\u007f")


def write_json(
    data: Mapping[str, Any], path: str | PathLike[str], *, indent: int | None = None
) -> None:
    """Write plain data as strict JSON. Raises StorageError."""
    write_text(path, json.dumps(data, indent=indent, allow_nan=False) + "\n")


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text, whole or not at all. Raises StorageError."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check_suffix(path: Path, suffixes: tuple[str, ...]) -> str:
    """Return a path's suffix in lower case. Raises StorageError for others than `suffixes`."""
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise StorageError(
            f"{path}: unknown suffix {path.suffix!r}; available: {', '.join(suffixes)}"
        )
    return suffix


def check_destination(path: str | PathLike[str], suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """Return `path` if it can be written. Raises StorageError, also for an unknown suffix."""
    path = Path(path)
    check_suffix(path, suffixes)
    with atomic_write(path, keep=False) as temporary:
        temporary.touch()
    return path


def numbered(path: Path) -> Iterator[Path]:
    """Yield a path, and then the same with a number: log.csv, log_2.csv, log_3.csv."""
    yield path
    yield from (path.with_stem(f"{path.stem}_{number}") for number in count(2))


def make_folder(path: str | PathLike[str]) -> Path:
    """Make a writable folder and its parents, and return it. Raises StorageError."""
    path = Path(path)
    with _said(path, "make"):
        path.mkdir(parents=True, exist_ok=True)
    check_destination(path / "probe.parquet")
    return path


@contextmanager
def atomic_write(path: str | PathLike[str], *, keep: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path`, which replaces it at the end. Raises StorageError.

    If the block raises or `keep` is false, `path` stays as it was.
    """
    path = Path(path)
    with _said(path, "write"):
        target = Path(os.path.realpath(path))  # target of a link
        if target.exists() and not target.is_file():
            raise FileExistsError(errno.EEXIST, "it exists and is not a regular file")
        if not target.parent.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, f"{target.parent} is not a folder; create it")
    stem = target.stem[:_STEM_KEPT]
    temporary = target.with_name(
        f".{stem}.{os.getpid():06x}{next(_COUNT) % 256:02x}.tmp{target.suffix}"
    )
    try:
        yield temporary
        if keep:
            _sync(temporary)
            os.replace(temporary, target)
            _sync(target.parent)
    except OSError as error:
        raise StorageError(f"{path}: can't write it: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    if os.name == "nt" and path.is_dir():
        return  # Windows opens no folders
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
