"""Read fields of mjModel and mjData by address: the pointers that compiled code can follow."""

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from helisim.physics.kernel import kernel


def _pointer_intrinsic(element: types.Type):
    @intrinsic
    def cast(typingctx, address):
        del typingctx
        signature = types.CPointer(element)(types.int64)

        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return signature, codegen

    return cast


doubles_at = _pointer_intrinsic(types.float64)
_ints_at = _pointer_intrinsic(types.int32)
_longs_at = _pointer_intrinsic(types.int64)


@kernel()
def doubles(base, offset):
    """Return the double array that a pointer field holds."""
    return doubles_at(_longs_at(base + offset)[0])


@kernel()
def doubles_from(base, offset, first):
    """Return the double array that a pointer field holds, from its element `first` on."""
    return doubles_at(_longs_at(base + offset)[0] + 8 * first)


@kernel()
def ints(base, offset):
    """Return the int array that a pointer field holds."""
    return _ints_at(_longs_at(base + offset)[0])


@kernel()
def long(base, offset):
    """Return the value of a 64-bit integer field."""
    return _longs_at(base + offset)[0]


@kernel()
def integer(base, offset):
    """Return the value of an int field."""
    return _ints_at(base + offset)[0]


@kernel()
def double(base, offset):
    """Return the value of a double field."""
    return doubles_at(base + offset)[0]


@intrinsic
def room(typingctx, count):
    """Return an array of doubles on the caller's own stack; `count` is a literal number."""
    del typingctx
    if not isinstance(count, types.IntegerLiteral):
        return None
    signature = types.CPointer(types.float64)(count)

    def codegen(context, builder, signature, args):
        del args
        element = context.get_value_type(types.float64)
        return cgutils.alloca_once(builder, element, size=signature.args[0].literal_value)

    return signature, codegen
