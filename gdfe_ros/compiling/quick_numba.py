# SPDX-License-Identifier: Apache-2.0
"""Quicker versions of functions of numba's compiler, in use while kernels are compiled.

They return the same results as numba's own versions. Together they save a fifth of a compilation's time. Numba spends
most of this fifth in Python: it compares flags, searches fifty templates for the type of each sum and product of two
numbers, and sends two messages for each call of LLVM. LLVM's passes over single functions are light ones here, because
its passes over the whole module repeat them; without any, steps take 3 % longer. A function that is always inlined gets
no machine code of its own. It is optimised only as part of its callers.

This module uses private parts of numba. `gdfe_ros.compiling.linked` uses it only with a tested version of numba.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from llvmlite.binding import ffi
from numba.core import codegen, compiler, config, event, ir, types
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.core.typed_passes import AnnotateTypes
from numba.core.types.functions import BaseFunction

_resolve = BaseFunction.get_call_type
_optimise, _finish = codegen.CPUCodeLibrary._optimize_final_module, codegen.CPUCodeLibrary._finalize_final_module
_set_environment = codegen.JITCPUCodegen.set_env
_found: dict[tuple[Any, ...], tuple[BaseFunction, Any]] = {}
"""Functions and signatures by the ids of function and context, and the types of the arguments."""
_hashes: dict[type, int] = {}
_hash = TargetConfig.__hash__
_defaults: dict[type, list[tuple[str, Any]]] = {}
_depth = [0]
"""1 inside a `quick` block of this process, else 0; nested blocks do not change it. Numba's compiler lock guards it."""


def flags_equal(self: TargetConfig, other: object) -> bool:
    """Return whether two sets of flags are equal; the defaults of flags that neither has set are not read."""
    if not isinstance(other, TargetConfig):
        return NotImplemented
    if type(self) is not type(other):
        return self.values() == other.values()
    mine, its = self._values, other._values
    if mine == its:
        return True
    defaults = ((name, self.options[name].default) for name in mine.keys() | its.keys())
    return all(mine.get(name, default) == its.get(name, default) for name, default in defaults)


def flags_hash(self: TargetConfig) -> int:
    """Return numba's hash of a set of flags; it depends only on the names of the flags."""
    kind = type(self)
    if kind not in _hashes:
        _hashes[kind] = _hash(self)
    return _hashes[kind]


def flag_values(self: TargetConfig) -> dict[str, Any]:
    """Return all flags by their names."""
    kind, given = type(self), self._values
    if kind not in _defaults:
        _defaults[kind] = [(name, option.default) for name, option in kind.options.items()]
    return {name: given.get(name, default) for name, default in _defaults[kind]}


def resolve_call(self: BaseFunction, context: Any, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
    """Return the signature of a call; signatures of built-in functions of numbers are remembered.

    Functions that numba implements in Python depend on flags of the caller, and are resolved each time.
    """
    if kws or not all(isinstance(each, (types.Number, types.Boolean)) for each in args):
        return _resolve(self, context, args, kws)
    key = (id(self), id(context), *args)
    if key not in _found:
        signature = _resolve(self, context, args, kws)
        if self._impl_keys[signature.args] is not self.typing_key:
            return signature
        _found[key] = self, signature
    return _found[key][1]


def list_variables(self: ir.Inst, value: Any) -> list[ir.Var]:
    """Return the variables in a part of an instruction."""
    if isinstance(value, ir.Var):
        return [value]
    if isinstance(value, ir.Inst):
        return value.list_vars()
    if isinstance(value, (list, tuple)):
        parts = value
    elif isinstance(value, dict):
        parts = value.values()
    else:
        return []
    return [found for part in parts if type(part) not in _PLAIN for found in list_variables(self, part)]


_PLAIN = frozenset((str, int, bool, float, type(None), ir.Loc))
"""Types of parts of instructions that contain no variable."""


def pass_lightly(self: codegen.CPUCodegen, **options: Any) -> tuple[Any, Any]:
    """Return LLVM's passes over single functions at its level 1; the passes over the module repeat them at level 3."""
    builder = self._pass_builder(opt=1, loop_vectorize=False, slp_vectorize=False)
    manager = builder.getFunctionPassManager()
    if config.LLVM_REFPRUNE_PASS:
        manager.add_refprune_pass(codegen._parse_refprune_flags())
    return manager, builder


def plain(kind: types.Type) -> types.Type:
    """Return the type for which a kernel is compiled: a constant counts as a variable, an int32 as an int64."""
    kind = types.unliteral(kind)
    return types.int64 if kind == types.int32 else kind


def is_inlined() -> bool:
    """Return whether the function that numba compiles now is always inlined, and has no entry for Python.

    A user's function may inherit the first flag from its caller, but always has an entry for Python.
    """
    flags = ConfigStack.top_or_none()
    return flags is not None and flags.forceinline and flags.no_cpython_wrapper


def optimise(self: codegen.CPUCodeLibrary) -> None:
    """Run LLVM's passes over a module; if the module is always inlined, run only the cheap passes."""
    if not is_inlined():
        _optimise(self)
        return
    passes, builder = self._codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=False, opt=0, cost="cheap")
    passes.run(self._final_module, builder)


def finish(self: codegen.CPUCodeLibrary) -> None:
    """Make the machine code of a module, unless it is always inlined."""
    if is_inlined():
        self._finalized = True
    else:
        _finish(self)


def set_environment(self: codegen.JITCPUCodegen, name: str, environment: Any) -> None:
    """Set the environment of a function with machine code."""
    if not is_inlined():
        _set_environment(self, name, environment)


def measure_nothing(kind: str, callback: Callable[[float], None]) -> AbstractContextManager[None]:
    """Return a context in which numba measures no time."""
    return nullcontext()


REPLACED: tuple[tuple[Any, str, Callable[..., Any]], ...] = (
    (TargetConfig, "__eq__", flags_equal),
    (TargetConfig, "__hash__", flags_hash),
    (TargetConfig, "values", flag_values),
    (BaseFunction, "get_call_type", resolve_call),
    (ir.Inst, "_rec_list_vars", list_variables),
    (codegen.CPUCodegen, "_function_pass_manager", pass_lightly),
    (codegen.CPUCodeLibrary, "_optimize_final_module", optimise),
    (codegen.CPUCodeLibrary, "_finalize_final_module", finish),
    (codegen.JITCPUCodegen, "set_env", set_environment),
    (event, "install_timer", measure_nothing),
)
"""Owner, name and replacement of each function."""


@contextmanager
def quick() -> Iterator[None]:
    """Use the replacements inside the ``with`` block. The caller holds numba's lock of the compiler."""
    if _depth[0]:
        yield
        return
    _depth[0] += 1
    originals = [getattr(owner, name) for owner, name, _ in REPLACED]
    for owner, name, replacement in REPLACED:
        setattr(owner, name, replacement)
    lock = ffi.lib._lock
    with lock:
        listeners, lock._cblist = lock._cblist, []
    try:
        yield
    finally:
        with lock:
            lock._cblist = listeners
        for (owner, name, _), original in zip(REPLACED, originals, strict=True):
            setattr(owner, name, original)
        _depth[0] -= 1


PARTS = {"build_tuple", "cast", "exhaust_iter", "getattr", "getiter", "iternext", "pair_first", "pair_second"}
"""Operations of numba's intermediate code that only unpack or pack their operands, and allocate nothing."""


@register_pass(mutates_CFG=False, analysis_only=False)
class LeaveOutReferences(AnalysisPass):
    """Switches off the counting of references to arrays in functions that make none; compiling takes a tenth less time.

    The caller of such a function holds references to the arrays that it passes, and thus to their parts.
    """

    _name = "leave_out_references"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """Switch the counts off, unless the function returns an array, may make one, or runs in threads."""
        if state.flags.auto_parallel.enabled:
            return False
        instructions = (each for block in state.func_ir.blocks.values() for each in block.body)
        found = [variable for each in instructions for variable in self._list_allocations(each)]
        kinds = [state.return_type, *(state.typemap[each.name] for each in found)]
        models = state.targetctx.data_model_manager
        if any(models[each].contains_nrt_meminfo() for each in kinds):
            return False
        state.flags.nrt, state.targetctx = False, state.targetctx.subtarget(enable_nrt=False)
        return True

    @staticmethod
    def _list_allocations(instruction: ir.Inst) -> tuple[ir.Var, ...]:
        """Return the variables for whose arrays the instruction may need memory."""
        if isinstance(instruction, (ir.SetItem, ir.StaticSetItem)):
            return (instruction.value,)
        if not isinstance(instruction, ir.Assign) or not isinstance(instruction.value, ir.Expr):
            return ()
        value = instruction.value
        if value.op == "getitem":
            return (value.index,)
        return () if value.op in PARTS or value.op == "static_getitem" else (instruction.target,)


class ReferencelessCompiler(compiler.Compiler):
    """Numba's compiler, with counts of references only where arrays are made."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's passes and `LeaveOutReferences`."""
        pipelines = super().define_pipelines()
        for each in pipelines:
            each.add_pass_after(LeaveOutReferences, AnnotateTypes)
            each.finalize()
        return pipelines
