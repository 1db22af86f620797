# SPDX-License-Identifier: GPL-3.0-or-later
"""All that depends on numba's own code: how kernels are compiled, and their code saved and loaded.

Kernels are compiled as numba does, with one change: a kernel always runs its own copies of the
kernels that it calls.

Each kernel's machine code contains copies of its callees, which LLVM optimizes once more within it,
so that they round differently from the callee's own code. Numba lets the copies of all kernels have
one name, and the process may run one that was loaded before. Results then depend, in the last
digits, on what a process has compiled or called earlier.
"""

import io
import pickle
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import llvmlite.binding as llvm
import numba
import numba.core.codegen
import numba.core.compiler
import numba.core.compiler_machinery
import numba.core.environment
import numba.core.typed_passes
from numba.core import serialize

from ...solver.shipped_code import ANNOTATION
from .code_folders import PACKAGE

# The versions whose internals this file was written for and tested with: from the first on, and
# before the second. Also in pyproject.toml.
TESTED_FROM = (0, 68)
TESTED_BEFORE = (0, 69)
if not TESTED_FROM <= numba.version_info[:2] < TESTED_BEFORE:
    raise ImportError(
        f"Scope keeps machine code in a way that was not tested with numba {numba.__version__}: "
        f"install numba >= {'.'.join(map(str, TESTED_FROM))}, < {'.'.join(map(str, TESTED_BEFORE))}"
    )

_codegen: Any = numba.core.codegen  # these declare no types
_compiler: Any = numba.core.compiler
_machinery: Any = numba.core.compiler_machinery
_passes: Any = numba.core.typed_passes
_rebuild: Any = _compiler.CompileResult._rebuild
_rebuild_environment: Any = numba.core.environment._rebuild_env
_dumps: Callable[[Any], bytes] = serialize.dumps


class _Library(_codegen.JITCodeLibrary):  # type: ignore[misc]
    """The machine code of one kernel, in which the copies of callees are invisible to other
    code.
    """

    def _finalize_final_module(self) -> None:
        """Make the module ready to use: after its optimization, before its compilation."""
        # what callers of this kernel copy from; see `_get_module_for_linking`
        shared = self._final_module.clone()
        for function in shared.functions:
            if not function.is_declaration and function.linkage == _codegen.ll.Linkage.external:
                function.linkage = "linkonce_odr"
        self._shared_module = shared
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == _codegen.ll.Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._finalize_final_module()


@_machinery.register_pass(mutates_CFG=False, analysis_only=True)
class _MakeLibrary(_machinery.LoweringPass):  # type: ignore[misc]
    """Make the library that the lowering pass would make otherwise."""

    _name = "scope_make_library"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        state.library = _Library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return False


class KernelCompiler(_compiler.CompilerBase):  # type: ignore[misc]
    """Numba's compiler without its Python mode, with kernels' own copies of their callees."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        passes = _compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_MakeLibrary, _passes.AnnotateTypes)
        passes.finalize()
        return [passes]


def use_kernel_compiler(kernel: Any) -> None:
    """Let a kernel be compiled by `KernelCompiler`, from its next signature on."""
    kernel._compiler.pipeline_class = KernelCompiler


def use_cache(kernel: Any, code_cache: Any) -> None:
    """Let a kernel's machine code be kept by another cache than numba's."""
    kernel._cache = code_cache


def payload_of(result: Any) -> bytes:
    """Return the machine code, what else numba keeps of a result, the names that the code defines,
    and the name of the package, for `load_result`.
    """
    reduced = list(result._reduce())
    reduced[ANNOTATION] = ""
    module = result.library._get_module_for_linking()
    values = [*module.functions, *module.global_variables]
    names = {value.name for value in values if not value.is_declaration}
    return _dumps((PACKAGE, _dumps((tuple(reduced), names))))


def load_result(target_context: Any, payload: bytes) -> Any:
    """Return what `payload_of` kept of a result; as numba's `_rebuild`, but without reading LLVM's
    code.

    Only kernels that are compiled later and call this one need that, and to read it takes a third
    of the time.
    """
    compiled_as, content = pickle.loads(payload)
    reduced, names = _OwnUnpickler(content, compiled_as).load()
    (name, kind, (code, bitcode)), descriptor, *others = reduced
    descriptor.modname = _own_name(descriptor.modname, compiled_as)
    target_context.codegen()._engine._defined_symbols |= names
    library = name, kind, (code, _no_bitcode())
    result = _rebuild(target_context, library, descriptor, *others)
    result.library._shared_module = None
    result.library._get_module_for_linking = partial(_read_bitcode, result.library, bitcode)
    return result


class _OwnUnpickler(pickle.Unpickler):
    """Reads what was kept under another name of this package: in a shell and a worker it is called
    ``scope``, and inside Blender ``bl_ext.<repository>.scope``.
    """

    def __init__(self, content: bytes, compiled_as: str) -> None:
        super().__init__(io.BytesIO(content))
        self._compiled_as = compiled_as

    def find_class(self, module: str, name: str) -> Any:
        """Return a class or function of a module."""
        found = super().find_class(_own_name(module, self._compiled_as), name)
        return self._rebuild_environment if found is _rebuild_environment else found

    def _rebuild_environment(self, module: str, *others: Any) -> Any:
        """Return the constants of a kernel, with the variables of its module."""
        return _rebuild_environment(_own_name(module, self._compiled_as), *others)


def _own_name(module: str, compiled_as: str) -> str:
    """Return the name in this process of a module of the package that was called ``compiled_as``;
    other modules have the same.
    """
    inside = module.removeprefix(f"{compiled_as}.")
    return module if inside == module else f"{PACKAGE}.{inside}"


def _read_bitcode(library: Any, bitcode: bytes) -> Any:
    """Return the LLVM module of a library whose code was kept."""
    if library._shared_module is None:
        library._shared_module = llvm.parse_bitcode(bitcode)
    return library._shared_module


@cache
def _no_bitcode() -> bytes:
    return bytes(llvm.parse_assembly("").as_bitcode())
