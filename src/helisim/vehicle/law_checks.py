"""Functions of a user as control laws: what they are called, whether they can be one."""

import hashlib
import inspect
from functools import partial
from typing import Any

from helisim.base.errors import InputError
from helisim.physics.laws import KnownLaw, arity, is_compiled, is_native


def source_digest(*functions: Any) -> str:
    """Return a digest of what functions or the classes of objects say, or of their bytecode."""
    digest = hashlib.blake2b(digest_size=16)
    for function in functions:
        if function is None:
            continue
        written = described(function)
        try:
            digest.update(inspect.getsource(written).encode())
        except (OSError, TypeError):
            code = getattr(written, "__code__", None)
            digest.update(code.co_code if code is not None else qualified_name(function).encode())
    return digest.hexdigest()


def described(function: Any) -> Any:
    """Return the function or class that a law is written as."""
    if isinstance(function, KnownLaw):
        return function.function
    if is_compiled(function):
        return function.py_func
    if is_native(function):
        return function._pyfunc
    if isinstance(function, partial):
        return described(function.func)
    return function if inspect.isroutine(function) else type(function)


def law_name(law: Any) -> str:
    """Return the name of a law's function or class, for messages."""
    return getattr(described(law), "__name__", repr(law))


def qualified_name(law: Any) -> str:
    """Return where a law is written, as module:name."""
    written = described(law)
    return f"{written.__module__}:{written.__qualname__}"


def check_law(law: Any, place: str) -> None:
    """Raise InputError if something can't be a law in its place, or a law's reset."""
    if is_native(law):
        if len(law._sig.args) != 4:
            raise InputError(
                "a numba.cfunc as a law has the signature void(double*, double*, double*, "
                f"double*), got {law._sig}"
            )
        return
    if not callable(law) or isinstance(law, type):
        what = "a controller" if place == "all" else f"{place} of a controller"
        other = {"swash": '"shipped"', "tail": '"shipped"'}.get(place, "a Controller")
        advice = f"; give an object of it, {law.__name__}(...)" if isinstance(law, type) else ""
        raise InputError(
            f"{what} must be a function of (seen, state, settings), an object that is called so, "
            f"{other} or None; got {law!r:.80}{advice}"
        )
    if arity(law) == 0 and place != "reset":
        raise InputError(
            f"controller {law_name(law)!r} takes nothing; it must take (seen), (seen, state) or "
            "(seen, state, settings)"
        )


def check_passes(law: Any, name: str) -> None:
    """Raise InputError if a law can't be found again by another process."""
    written = described(law)
    found = "<" not in getattr(written, "__qualname__", "") or is_compiled(law)
    if is_native(law) or not found:
        what = "a numba.cfunc" if is_native(law) else "defined inside a function"
        raise InputError(
            f"controller {name!r} can't pass to another process: it is {what}; take a function "
            "at the top of a module that both can import, plain or compiled by numba.njit"
        )
