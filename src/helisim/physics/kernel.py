"""How the force laws are compiled: functions into MuJoCo's callbacks, layouts into their code.

From Python, both are what they look like: a function and a named tuple of whole numbers.
"""

from functools import partial
from typing import Any, TypeVar

from numba import types
from numba.core.imputils import lower_constant
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    lower_getattr_generic,
    models,
    register_jitable,
    register_model,
    typeof_impl,
)

kernel = partial(
    register_jitable,
    error_model="numpy",
    forceinline=True,
    no_cpython_wrapper=True,
    no_cfunc_wrapper=True,
    _nrt=False,
)
"""Compiled, a division by zero gives infinity, as in C; the flight then counts as diverged.

No wrappers to call the compiled code from Python and no counting of references: together they
took half of the time to compile.
"""

Numbers = TypeVar("Numbers", bound=tuple[int, ...])


class Known(types.Dummy):
    """The type of one layout, a named tuple of whole numbers that compiled code knows.

    PARAM.tau_f is a literal there, not a lookup. To numba a named tuple is a value with as many
    members as it has names, which every use writes out and every call hands on: half of the time
    that the force laws took to compile. Here the numbers are part of the type, and the value is
    nothing.
    """

    def __init__(self, numbers: Any) -> None:
        self.numbers = numbers
        super().__init__(type(numbers).__name__)

    @property
    def key(self) -> Any:
        """What tells two such types apart."""
        return type(self.numbers), self.numbers


register_model(Known)(models.OpaqueModel)


def known(numbers: type[Numbers]) -> type[Numbers]:
    """Let compiled code know the numbers of each tuple of this class."""
    typeof_impl.register(numbers)(lambda value, context: Known(value))
    return numbers


@infer_getattr
class _Names(AttributeTemplate):
    key = Known

    def generic_resolve(self, value: Any, name: str) -> Any:
        return types.intp if name in value.numbers._fields else None


@lower_getattr_generic(Known)
def _number(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    return context.get_constant(types.intp, getattr(kind.numbers, name))


@lower_constant(Known)
def _nothing(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.get_dummy_value()
