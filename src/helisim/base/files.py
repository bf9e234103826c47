"""Reads and writes files: each is written whole or not at all, and too large a one refused."""

import json
import os
import re
import time
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any

from helisim.base.errors import StorageError

SUFFIXES = (".parquet", ".csv")
"""Of flight records."""

MAX_BYTES = 2 << 30
"""A larger file is refused: it would not fit into memory as numbers."""

_TOML_BYTES = 1 << 20
"""A larger TOML file is refused: people write them by hand."""

_STEM_KEPT = 40
"""Characters of a file's name in its temporary's, whose name may have 255 bytes."""

_STALE = 2.0
"""s, for which a temporary file is untouched that a killed process, perhaps elsewhere, left."""

_COUNT = count()
"""Of the files that this process writes, so that two at a time have different names."""

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def read_bytes(path: str | PathLike[str], *, limit: int = MAX_BYTES) -> bytes:
    """Return a file's bytes. Raises StorageError, also for a file larger than `limit`."""
    path = Path(path)
    file_size(path, limit=limit)
    try:
        return path.read_bytes()
    except OSError as error:
        raise StorageError(f"{path}: can't read it: {_reason(error)}") from None


def file_size(path: str | PathLike[str], *, limit: int = MAX_BYTES) -> int:
    """Return a regular file's size, bytes. Raises StorageError, also beyond `limit`."""
    path = Path(path)
    try:
        if not path.is_file():
            missing = "not a regular file" if path.exists() else "no such file"
            raise StorageError(f"{path}: {missing}")
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        raise StorageError(f"{path}: can't read it: {_reason(error)}") from None
    if size > limit:
        raise StorageError(f"{path}: {size} bytes, and at most {limit} are read")
    return size


def first_bytes(path: str | PathLike[str], count: int) -> bytes:
    """Return up to `count` bytes that a file begins with. Raises StorageError."""
    file_size(path)
    try:
        with Path(path).open("rb") as file:
            return file.read(count)
    except OSError as error:
        raise StorageError(f"{path}: can't read it: {_reason(error)}") from None


def pieces(path: str | PathLike[str], *, size: int = 1 << 20) -> Iterator[bytes]:
    """Yield a file's bytes, up to `size` at a time. Raises StorageError."""
    try:
        with Path(path).open("rb") as file:
            while data := file.read(size):
                yield data
    except OSError as error:
        raise StorageError(f"{path}: can't read it: {_reason(error)}") from None


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


def parse_object(text: str | bytes, what: str) -> dict[str, Any]:
    """Return the JSON object that a text is. Raises StorageError, which begins with `what`."""
    try:
        data = json.loads(text)
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
    """Return a name as TOML writes a key: bare where it can be."""
    return name if _BARE_KEY.fullmatch(name) else toml_value(name)


def toml_value(item: object) -> str:
    """Return a number, a truth value, text, or a list of such as TOML."""
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
    with atomic_write(path) as temporary:
        text = json.dumps(data, indent=indent, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")


def check_suffix(path: Path, suffixes: tuple[str, ...]) -> str:
    """Return a path's suffix in lower case. Raises StorageError unless it is one of those."""
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise StorageError(
            f"{path}: unknown suffix {path.suffix!r}; available: {', '.join(suffixes)}"
        )
    return suffix


def check_destination(path: str | PathLike[str], suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """Return `path` if a file could be written there now, so that long work is not in vain.

    Raises:
        StorageError: unknown suffix, or the folder or an existing file can't be written.
    """
    path = Path(path)
    check_suffix(path, suffixes)
    with atomic_write(path, keep=False) as temporary:
        temporary.touch()
    return path


def make_folder(path: str | PathLike[str]) -> Path:
    """Make a folder, and those above it, that files can be written to; return it.

    Raises:
        StorageError: it can't be made or written.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise StorageError(f"can't make the folder {path}: {_reason(error)}") from None
    check_destination(path / "probe.parquet")
    return path


@contextmanager
def atomic_write(path: str | PathLike[str], *, keep: bool = True) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and put it in place at the end.

    When the block raises, or `keep` is false, `path` stays as it was and the temporary file
    is removed. When the process is killed, `path` stays as it was too, and a temporary file
    whose name begins with a dot is left beside it, which the next write of `path` removes.

    Raises:
        StorageError: the folder doesn't exist or can't be written, `path` is not a regular
            file, or writing fails.
    """
    path = Path(path)
    try:
        target = _target(path)
    except (OSError, ValueError) as error:
        raise StorageError(f"{path}: can't write it: {_reason(error)}") from None
    stem = target.stem[:_STEM_KEPT]
    temporary = target.with_name(
        f".{stem}.{os.getpid():06x}{next(_COUNT) % 256:02x}.tmp{target.suffix}"
    )
    try:
        yield temporary
        if keep:
            _sync(temporary)
            os.replace(temporary, target)
            _remove_stale(target, stem)
            _sync(target.parent)
    except OSError as error:
        raise StorageError(f"{path}: can't write it: {_reason(error)}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _remove_stale(target: Path, stem: str) -> None:
    """Remove temporary files of the same target that processes which were killed have left."""
    left = re.compile(
        rf"\.{re.escape(stem)}\.([0-9a-f]{{6,}})[0-9a-f]{{2}}\.tmp{re.escape(target.suffix)}"
    )
    for one in target.parent.iterdir():
        match = left.fullmatch(one.name)
        if match and not _is_alive(int(match[1], 16)):
            with suppress(OSError):
                if time.time() - one.stat().st_mtime > _STALE:
                    one.unlink()


def _is_alive(process: int) -> bool:
    """Return whether a process of this machine runs; True where it can't be told."""
    if os.name == "nt":
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _target(path: Path) -> Path:
    """Return the file that is to be replaced: where a link points to, or the path itself."""
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise StorageError(f"{path}: can't write it: it exists and is not a regular file")
    if not target.parent.is_dir():
        raise StorageError(f"{path}: can't write it: {target.parent} is not a folder; create it")
    return target


def _sync(path: Path) -> None:
    """Have a file on the disk before its name is, and the name before it is said to be there."""
    if os.name == "nt" and path.is_dir():
        return  # Windows opens no folders
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
