"""Where numbers come from, as plain data: stated in every file, checked, and compared."""

import json
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from helisim.base.errors import RecordError
from helisim.base.value import FrozenMap

_PROGRAMS = ("helisim", "mujoco", "numpy", "scipy", "numba", "control", "pyarrow")


def made_by(what: str, **facts: Any) -> dict[str, Any]:
    """Return the provenance of something that helisim made: by what, with which versions.

    Args:
        what: the part of helisim, such as "simulation".
        facts: plain data that the result depends on: configuration, seed, model.
    """
    known = versions()
    return {"made_by": f"helisim {known['helisim']}, {what}", "versions": known, **facts}


def versions() -> dict[str, str]:
    """Return the versions of all that numbers depend on, Python and the machine's kind too."""
    return dict(_versions())


@cache
def _versions() -> Mapping[str, str]:
    kind = f"{platform.system()} {platform.machine()}".strip()
    found = {"python": platform.python_version(), "machine": kind}
    for program in _PROGRAMS:
        try:
            found[program] = version(program)
        except PackageNotFoundError:  # identification alone needs no simulator
            found[program] = "none"
    return found


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit linear algebra to one thread within the block: the same bits on any processor count.

    BLAS adds up in another order when it works in several threads. Their number is the process's,
    and threadpoolctl leaves it to the first Python thread that sets it: where several Python
    threads identify at once, last digits may still move.
    """
    with _blas().limit(limits=1, user_api="blas"):
        yield


@cache
def _blas() -> Any:
    import scipy.linalg  # noqa: F401, which brings a BLAS of its own, to be limited too
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


class Plain(FrozenMap[str, Any]):
    """Provenance that is known to be plain data: records that have it in common share it."""

    __slots__ = ()

    def extended(self, **facts: Any) -> "Plain":
        """Return it with further facts, the known ones shared. Raises RecordError."""
        return Plain({**self, **plain(facts)})


def plain(provenance: Mapping[str, Any]) -> Plain:
    """Return provenance as JSON would give it back: tuples become lists.

    Raises:
        RecordError: it isn't plain JSON data.
    """
    if isinstance(provenance, Plain):
        return provenance
    try:
        return Plain(json.loads(json.dumps(dict(provenance), allow_nan=False)))
    except (TypeError, ValueError) as error:
        raise RecordError(f"provenance must be plain JSON data: {error}") from None


def one_line(data: Mapping[str, Any]) -> str:
    """Return JSON that is the same for equal data, whatever the order of the keys."""
    return json.dumps(data, sort_keys=True, ensure_ascii=False, allow_nan=False)


def difference(found: Any, expected: Any, name: str = "") -> str:
    """Return the first difference between two pieces of plain data in words, "" if none."""
    if isinstance(found, Mapping) and isinstance(expected, Mapping):
        for key in (*expected, *(key for key in found if key not in expected)):
            inner = f"{name}.{key}" if name else str(key)
            change = difference(found.get(key), expected.get(key), inner)
            if change:
                return change
        return ""
    return "" if found == expected else f"{name} is {found!r} there and {expected!r} here"
