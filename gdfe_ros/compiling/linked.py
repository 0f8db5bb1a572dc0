# SPDX-License-Identifier: Apache-2.0
"""Kernels that call each other by their addresses, so that each kernel is compiled once.

Numba compiles a kernel anew as a part of each kernel that calls it, directly or through others. In a chain of ten
kernels, the last is thus compiled, and stored in the cache, ten times. Here a kernel above `LARGE` instructions gets a
symbol, and its callers contain only this symbol. LLVM would not inline such a kernel anyway. Smaller ones are inlined.

The cache of a kernel lists the symbols that it calls. They are loaded, or compiled, before the kernel is loaded. If a
called kernel now returns another type, the caller is compiled anew. All this uses private parts of numba: with a
version that was not tested, kernels are plain functions of numba, which compile for longer.
"""

from __future__ import annotations

import errno
import hashlib
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from copy import copy
from functools import lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numba
from numba.core import cgutils, compiler, config, sigutils
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, NullCache
from numba.core.ccallback import CFunc
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import TypingError
from numba.core.funcdesc import FunctionDescriptor
from numba.core.imputils import fix_returning_optional, impl_ret_new_ref
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys
from numba.core.targetconfig import ConfigStack

from gdfe_ros.compiling.compilations import compilations, lock_file, unlock_file
from gdfe_ros.compiling.quick_numba import ReferencelessCompiler, plain, quick
from gdfe_ros.entry import without_collection

LARGE = 200
"""Number of LLVM's instructions above which a kernel is called by its address. LLVM inlines kernels below about 50."""
TESTED = numba.version_info.short == (0, 68)
"""Whether this version of numba was tested."""
PREFIX = "gdfe."
"""Beginning of the symbols of kernels."""


class CalledKernel(NamedTuple):
    """A kernel that another one calls by its address: module, name, types of the arguments, and the symbol."""

    module: str
    name: str
    arguments: tuple
    symbol: str


FORMAT = "gdfe 5"
"""Mark of cache files with links."""
_compiling: list[object] = []
"""The functions of this module's caches that are being compiled; numba compiles one at a time."""
_links: dict[str, CalledKernel] = {}
"""The kernels of this process that have an address, by their symbols."""


def link_of(result: CompileResult) -> CalledKernel:
    """Return the link of a compiled kernel; its symbol is made of the name and the types of arguments and result."""
    given = result.signature.args, result.signature.return_type
    digest = hashlib.sha256(repr(given).encode()).hexdigest()[:16]
    module, name = result.fndesc.modname, result.fndesc.qualname
    return CalledKernel(module, name, tuple(result.signature.args), f"{PREFIX}{module}.{name}.{digest}")


def is_large(result: CompileResult) -> bool:
    """Return whether a compiled kernel has more than `LARGE` instructions."""
    function, count = result.library.get_function(result.fndesc.llvm_func_name), 0
    for block in function.blocks:
        for _ in block.instructions:
            count += 1
        if count > LARGE:
            return True
    return False


def publish(result: CompileResult) -> None:
    """Register a large kernel that is compiled or loaded: from now on, numba writes calls of it with its symbol."""
    link, context = link_of(result), result.target_context
    address = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
    if not address:
        raise RuntimeError(f"kernel {link.module}.{link.name} has no address")
    llvm.add_symbol(link.symbol, address)
    _links[link.symbol] = link
    context.remove_user_function(result.entry_point)
    call = call_of(link.symbol, address, result.fndesc)
    context._defns[result.entry_point].append(call, call.signature)


def call_of(symbol: str, address: int, called: FunctionDescriptor) -> Callable[..., Any]:
    """Return the function that writes a call of a kernel into the code of a caller.

    If a cache of this module stores the caller, the call is by symbol. Otherwise it is by address, because numba's own
    cache does not know symbols. Numba's cache stores no function that contains an address, and warns of it.
    """

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if _compiling:
            named = copy(called)
            named.mangled_name = symbol
            function = context.declare_function(builder.module, named)
        else:
            kind = context.call_conv.get_function_type(called.restype, called.argtypes).as_pointer()
            function = builder.bitcast(context.add_dynamic_addr(builder, address, info=symbol), kind)
        given = function, called.restype, called.argtypes, arguments
        status, value = context.call_conv.call_function(builder, *given)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        value = fix_returning_optional(context, builder, signature, status, value)
        return impl_ret_new_ref(context, builder, called.restype, value)

    write.signature, write.libs = called.argtypes, ()
    return write


def links_in(result: CompileResult) -> list[CalledKernel]:
    """Return the kernels that a compiled kernel calls by their addresses."""
    functions = result.library._final_module.functions
    return [_links[each.name] for each in functions if each.is_declaration and each.name.startswith(PREFIX)]


def names_in(module: llvm.ModuleRef) -> bytes:
    """Return bitcode that defines the symbols of a module, with empty functions.

    Numba reads the bitcode of each kernel that it loads, in order to inline the kernel. A large kernel is not inlined:
    its machine code and the names of its symbols are enough.
    """
    functions = [
        f'define void @"{each.name}"() {{ unreachable }}' for each in module.functions if not each.is_declaration
    ]
    values = [f'@"{each.name}" = global i8 0' for each in module.global_variables if not each.is_declaration]
    return llvm.parse_assembly("\n".join(values + functions)).as_bitcode()


def resolve(link: CalledKernel) -> bool:
    """Load or compile a kernel; return whether it still exists, takes these arguments and has the symbol."""
    try:  # it may have changed while the file of the caller is the same
        found = getattr(import_module(link.module), link.name, None)
        if not isinstance(found, LinkedDispatcher):
            return False
        found.compile(link.arguments)
    except (ModuleNotFoundError, TypingError):
        return False
    return link_of(found.overloads[link.arguments]).symbol == link.symbol


class LinkedCacheImpl(CompileResultCacheImpl):
    """Stores a compiled kernel together with the kernels that it calls."""

    def reduce(self, result: CompileResult) -> tuple[Any, ...]:
        """Return the contents of a cache file."""
        links, large = [tuple(link) for link in links_in(result)], is_large(result)
        (name, kind, (code, bitcode)), *others = super().reduce(result)
        if large and not result.fndesc.inline:
            bitcode = names_in(result.library._final_module)
        return links, large, ((name, kind, (code, bitcode)), *others)

    def rebuild(self, context: Any, stored: tuple[Any, ...]) -> CompileResult | None:
        """Return the kernel from the contents of a cache file; None if a kernel that it calls has changed."""
        links, large, contents = stored
        if not all(resolve(CalledKernel(*link)) for link in links):
            return None
        with ConfigStack().enter(compiler.Flags()):  # not those of a caller that is being compiled
            result = super().rebuild(context, contents)
        result.library.large = large
        return result


class LinkedCacheFile(IndexDataCacheFile):
    """The files of a cache; files of another version of the package, with types that are gone, count as absent."""

    def _load_index(self) -> dict[Any, str]:
        with suppress(ImportError, AttributeError):
            return super()._load_index()
        return {}

    def load(self, key: Any) -> Any:
        """Return the contents of the file for numba's key of a signature; None if there is none."""
        with suppress(ImportError, AttributeError):
            return super().load(key)
        return None


class LinkedCache(FunctionCache):
    """Cache of one kernel. If another process compiles the kernel, this process waits and then loads it."""

    _impl_class = LinkedCacheImpl
    _lock: int | None = None

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = LinkedCacheFile(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, signature: Any, context: Any) -> CompileResult | None:
        """Return the stored kernel; None if it must be compiled: other processes then wait until `release`.

        Numba's own method first imports everything that it can compile: half of the time to load a scene's kernels.
        """
        rtsys.initialize(context)
        with self._guard_against_spurious_io_errors():
            found = self._load_overload(signature, context)
        if found is None and self._lock is None:
            with self._guard_against_spurious_io_errors():
                self._impl.locator.ensure_cache_path()
                self._lock = lock_file(f"{self._cache_file._index_path}.lock")
            found = super().load_overload(signature, context)
        return found

    @contextmanager
    def _guard_against_spurious_io_errors(self) -> Iterator[None]:
        """Warn if the disk of the cache is full, and go on: the kernel then serves this process only."""
        try:
            yield
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                raise
            warn_once(self._cache_path, error.strerror)

    def release(self) -> None:
        """Let other processes compile or load the kernel."""
        if self._lock is not None:
            unlock_file(self._lock, f"{self._cache_file._index_path}.lock")
            self._lock = None

    def _index_key(self, signature: Any, codegen: Any) -> tuple[Any, ...]:
        """Return numba's key with a mark, so that files of a plain `FunctionCache` are not read."""
        return *super()._index_key(signature, codegen), FORMAT


@lru_cache
def warn_once(folder: str, defect: str) -> None:
    """Warn that the folder of a cache cannot be written; each text once in a process."""
    remedy = "kernels are compiled at each start; remedy: free space, or another NUMBA_CACHE_DIR"
    warnings.warn(f"cache of kernels, {folder}: {defect}; {remedy}", stacklevel=2)


@contextmanager
def releasing(cache: LinkedCache | NullCache) -> Iterator[None]:
    """Release the lock of a cache at the end of the ``with`` block that took it; blocks may be nested."""
    held = isinstance(cache, LinkedCache) and cache._lock is not None
    try:
        yield
    finally:
        if isinstance(cache, LinkedCache) and not held:
            cache.release()


@contextmanager
def linking(compiled: object) -> Iterator[None]:
    """Compile ``compiled`` inside the ``with`` block, with `quick`; its calls of large kernels are by symbol.

    The linker resolves a symbol to the address of a kernel that is compiled or loaded separately. The search for cyclic
    garbage, which takes a fifth of a compilation's time and finds little, is off.
    """
    with without_collection(keep=False), global_compiler_lock, quick():
        _compiling.append(compiled)
        try:
            yield
        finally:
            _compiling.pop()


class CountedCompiler(ReferencelessCompiler):
    """Compiles kernels and counts them."""

    def compile_extra(self, function: Any) -> CompileResult:
        """Compile a function."""
        compilations.running += 1
        try:
            return super().compile_extra(function)
        finally:
            compilations.running -= 1
            compilations.compiled += 1


class LinkedDispatcher(CPUDispatcher):
    """A compiled function that other ones call by its address, if it is large."""

    def enable_caching(self) -> None:
        """Store compiled versions on disk."""
        self._cache = LinkedCache(self.py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return the function for types of arguments, each made `plain`, so that fewer versions are compiled."""
        return super().get_call_template(tuple(map(plain, args)), {name: plain(each) for name, each in kws.items()})

    def compile(self, signature: Any) -> Any:
        """Compile for a signature, or load from the cache; return the entry point."""
        before = len(self.overloads)
        with linking(self), releasing(self._cache):
            entry = super().compile(signature)
        if len(self.overloads) > before:
            result = next(reversed(self.overloads.values()))
            large = getattr(result.library, "large", None)
            if not result.fndesc.inline and (is_large(result) if large is None else large):
                publish(result)
        return entry


class InternalDispatcher(LinkedDispatcher):
    """A compiled function without an entry for Python."""

    def __call__(self, *_: Any) -> None:
        """Raise a TypeError: numba would jump to address 0, and end the process."""
        raise TypeError(f"{self.py_func.__qualname__} has no entry for Python; only other kernels may call it")


class LinkedEntry(CFunc):
    """A compiled function for C that calls linked kernels, with a cache."""

    def enable_caching(self) -> None:
        """Store compiled versions on disk."""
        self._cache = LinkedCache(self._pyfunc)

    def compile(self) -> None:
        """Compile, or load from the cache."""
        with linking(self), releasing(self._cache):
            super().compile()


def compile_linked_entry(signature: Any, function: Callable[..., Any], *, cache: bool) -> LinkedEntry:
    """Return numba's ``cfunc(signature, cache=cache)(function)``; with a tested numba, it is a `LinkedEntry`."""
    if not TESTED:
        return numba.cfunc(signature, cache=cache)(function)
    entry = LinkedEntry(function, sigutils.normalize_signature(signature), locals={}, options={})
    if cache:
        entry.enable_caching()
    entry.compile()
    return entry


def compile_linked(*, cache: bool, **options: Any) -> Any:
    """Return a decorator like numba's ``njit(cache=cache, **options)``; with a tested numba, it links the kernels."""
    if not TESTED:
        return numba.njit(cache=cache, **options)

    def decorate(function: Any) -> Any:
        if config.DISABLE_JIT:
            return function
        given = {"nopython": True, "boundscheck": None, **options}
        counted = CountedCompiler if cache else ReferencelessCompiler
        kind = InternalDispatcher if options.get("no_cpython_wrapper") else LinkedDispatcher
        dispatcher = kind(function, targetoptions=given, pipeline_class=counted)
        if cache:
            dispatcher.enable_caching()
        return dispatcher

    return decorate
