"""Compilation of the force laws: functions, layouts, and the memory that their pointers reach."""

import gc
import hashlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding
import mujoco
import numba
from llvmlite import ir
from numba import _dynfunc, types
from numba.core import cgutils, typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.imputils import lower_constant
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_jitable,
    register_model,
    typeof_impl,
)

_IDLE = {  # needless in kernels
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
    typed_passes.AnnotateTypes,
    typed_passes.IRLegalization,
    typed_passes.DumpParforDiagnostics,
}


class _Part(JITCodeLibrary):
    def finalize(self) -> None:
        self._finalized = True

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:  # to numba's library those count too
                manager, builder = self._codegen._function_pass_manager()
                manager.run(function, builder)

    def _parts(self) -> dict[Any, None]:
        found: dict[Any, None] = {}
        pending = list(self._linking_libraries)
        while pending:
            one = pending.pop()
            if one not in found:
                found[one] = None
                pending += one._linking_libraries if isinstance(one, _Part) else ()
        return found

    def _link(self, module: Any) -> None:
        for one in self._parts():
            module.link_in(JITCodeLibrary._get_module_for_linking(one), preserve=True)

    def _get_module_for_linking(self) -> Any:
        module = super()._get_module_for_linking().clone()
        self._link(module)
        return module


class _Whole(_Part):
    def finalize(self) -> None:
        self._link(self._final_module)
        self._linking_libraries.clear()
        JITCodeLibrary.finalize(self)

    def _optimize_final_module(self) -> None:
        manager, builder = self._codegen._module_pass_manager()
        manager.run(self._final_module, builder)


class CallbackCompiler(CompilerBase):
    """Compiles what MuJoCo calls: a `pipeline_class` of `numba.cfunc`."""

    library: type[JITCodeLibrary] = _Whole

    def define_pipelines(self) -> list[Any]:
        """Return numba's own pipeline without the passes that have nothing to do in kernels."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes = [one for one in pipeline.passes if one[0] not in _IDLE]
        context = self.state.targetctx
        self.state.library = self.library(context.codegen(), self.state.func_id.func_qualname)
        self.state.library.enable_object_caching()
        return [pipeline]


class _KernelCompiler(CallbackCompiler):
    library = _Part

    def define_pipelines(self) -> list[Any]:
        pipelines = super().define_pipelines()
        self.state.targetctx.get_executable = _without_code
        return pipelines


def _without_code(library: Any, description: Any, environment: Any) -> Any:
    """Return a stand-in for the function that Python would call: a kernel has no such code."""
    name = description.qualname.rpartition(".")[2]
    module = description.lookup_module()
    return _dynfunc.make_function(module, name, "", 1, environment, (library,))


kernel = partial(
    register_jitable,
    error_model="numpy",
    forceinline=True,
    no_cpython_wrapper=True,
    no_cfunc_wrapper=True,
    pipeline_class=_KernelCompiler,
    _nrt=False,
)
"""Compiled, a division by zero gives infinity, as in C; the flight then counts as diverged."""


def fingerprint(*more: Path) -> int:
    """Return a number of the physics' sources, libraries and more files, for numba's cache."""
    digest = hashlib.sha256(f"{mujoco.__version__} {numba.__version__}".encode())
    for source in (*sorted(Path(__file__).parent.glob("*.py")), *more):
        digest.update(source.read_bytes())
    return int.from_bytes(digest.digest()[:7], "little")


def compiled_or_cached(compiled: Callable[[bool], Any]) -> Any:
    """Return what a function compiles when told whether to cache it on disk, beside its source."""
    collects = gc.isenabled()
    gc.disable()
    try:
        return compiled(True)
    except RuntimeError as error:
        if "cache" not in str(error):
            raise
        return compiled(False)
    finally:
        if collects:
            gc.enable()


Numbers = TypeVar("Numbers", bound=tuple[int, ...])


class Known(types.Dummy):
    """The type of one layout, a named tuple of whole numbers that compiled code knows."""

    def __init__(self, numbers: Any) -> None:
        self.numbers = numbers
        super().__init__(type(numbers).__name__)

    @property
    def key(self) -> Any:
        """Identity of the type: class and numbers."""
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


def _pointer_intrinsic(element: types.Type):
    @intrinsic
    def cast(typingctx, address):
        signature = types.CPointer(element)(types.int64)

        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return signature, codegen

    return cast


doubles_at = _pointer_intrinsic(types.float64)
ints_at = _pointer_intrinsic(types.int32)
longs_at = _pointer_intrinsic(types.int64)


def address_of(symbol: str, address: int):
    """Return a function for kernels that returns an address of this process, under a name."""
    llvmlite.binding.add_symbol(symbol, address)

    @intrinsic
    def known(typingctx):
        def codegen(context, builder, signature, args):
            found = builder.module.globals.get(symbol)
            found = found or cgutils.add_global_variable(builder.module, ir.IntType(64), symbol)
            return builder.ptrtoint(found, ir.IntType(64))

        return types.int64(), codegen

    return known


@intrinsic
def call(typingctx, function, arguments):
    """Call a C function without a result by its address, with a tuple of numbers and pointers."""

    def codegen(context, builder, signature, args):
        given = cgutils.unpack_tuple(builder, args[1])
        kind = ir.FunctionType(ir.VoidType(), [one.type for one in given])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), given)
        return context.get_dummy_value()

    return types.void(function, arguments), codegen


@intrinsic
def from_element(typingctx, array, first):
    """Return an array of doubles from its element `first` on."""

    def codegen(context, builder, signature, args):
        return builder.gep(args[0], [args[1]])

    return array(array, first), codegen


@intrinsic
def buffer(typingctx, count):
    """Return an uninitialised array of doubles, (count,), a literal, on the caller's own stack."""
    if not isinstance(count, types.IntegerLiteral):
        return None
    signature = types.CPointer(types.float64)(count)

    def codegen(context, builder, signature, args):
        element = context.get_value_type(types.float64)
        return cgutils.alloca_once(builder, element, size=signature.args[0].literal_value)

    return signature, codegen
