# SPDX-License-Identifier: GPL-3.0-or-later
"""How numba compiles kernels, with one change: a kernel always runs its own copies of the kernels
that it calls.

Each kernel's machine code contains copies of its callees, which LLVM optimizes once more within it,
so that they round differently from the callee's own code. Numba lets the copies of all kernels have
one name, and the process may run one that was loaded before. Results then depend, in the last
digits, on what a process has compiled or called earlier.
"""

from typing import Any

import numba.core.codegen
import numba.core.compiler
import numba.core.compiler_machinery
import numba.core.typed_passes

_codegen: Any = numba.core.codegen  # these declare no types
_compiler: Any = numba.core.compiler
_machinery: Any = numba.core.compiler_machinery
_passes: Any = numba.core.typed_passes


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
