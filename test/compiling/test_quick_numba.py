# SPDX-License-Identifier: Apache-2.0
"""The replaced functions of numba's compiler return what numba's own return, and are gone after a compilation."""

from __future__ import annotations

import operator

import numba
import numpy as np
import pytest
from llvmlite.binding import ffi
from numba.core import ir, typing
from numba.core.compiler import Flags
from numba.core.registry import cpu_target
from numba.core.types import boolean, float32, float64, int8, int32, int64, intp, uint64

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.compiling.quick_numba import REPLACED, flags_equal, flags_hash, quick

NUMBERS = (boolean, int8, int32, int64, uint64, float32, float64)
OPERATORS = (operator.add, operator.sub, operator.mul, operator.truediv, operator.pow, operator.lt, operator.and_)


def signatures() -> list[typing.Signature]:
    """Return the signatures of operators of two numbers; None where there is none."""
    found, context = [], cpu_target.typing_context
    for function in OPERATORS:
        for left in NUMBERS:
            for right in NUMBERS:
                try:
                    found.append(context.resolve_function_type(function, (left, right), {}))
                except numba.TypingError:
                    found.append(None)
    return found


def test_operators_of_numbers_have_numbas_signatures() -> None:
    """Each operator of two numbers has numba's own signature, also when it is asked for again."""
    wanted = signatures()
    with quick():
        assert signatures() == wanted
        assert signatures() == wanted


def test_flags_are_equal_where_numba_finds_them_equal() -> None:
    """Flags that are set to their defaults equal flags that are not set; others differ; hashes agree."""
    unset, default, other = Flags(), Flags(), Flags()
    default.nrt, other.nrt = Flags.options["nrt"].default, not Flags.options["nrt"].default
    assert (unset == default, unset == other) == (True, False)
    assert (flags_equal(unset, default), flags_equal(unset, other)) == (True, False)
    assert flags_equal(unset, 3) is NotImplemented
    assert len({flags_hash(each) for each in (unset, default)}) == 1
    values = unset.values()
    with quick():
        assert unset.values() == values


def test_variables_of_instructions_are_numbas() -> None:
    """All variables in nested parts of an instruction are listed, in numba's order."""
    place = ir.Loc("here", 1)
    a, b, c = (ir.Var(None, name, place) for name in "abc")
    call = ir.Expr.call(a, [b, 1, ("text", c)], (("key", b),), place)
    instruction = ir.Assign(call, c, place)
    wanted = instruction.list_vars()
    with quick():
        assert instruction.list_vars() == wanted
    assert {each.name for each in wanted} == {"a", "b", "c"}


def test_numba_is_as_before_after_a_compilation_that_fails() -> None:
    """Numba's functions and the listeners of LLVM's lock are back, though a kernel cannot be compiled."""
    before = [getattr(owner, name) for owner, name, _ in REPLACED]
    listeners = list(ffi.lib._lock._cblist)
    assert listeners

    @kernel
    def bad(values):
        return values.no_such_attribute

    with pytest.raises(numba.TypingError):
        bad(np.zeros(3))
    assert [getattr(owner, name) for owner, name, _ in REPLACED] == before
    assert list(ffi.lib._lock._cblist) == listeners
    assert not {replacement for *_, replacement in REPLACED} & set(before)


def test_a_part_of_kernels_has_one_version_and_no_machine_code() -> None:
    """A function that is always inlined is compiled once for constants and integers of 32 and 64 bits, without code."""

    @inlined
    def entry(values, i):
        return values[i] + helped(values[0])

    @numba.njit
    def helped(value):
        return 2.0 * value

    @kernel
    def total(values, indices):
        return entry(values, 1) + entry(values, indices[0]) + entry(values, len(indices))

    values = np.array([1.0, 10.0, 100.0])
    assert total(values, np.array([2, 2], np.int32)) == 10.0 + 100.0 + 100.0 + 3 * 2.0
    (result,) = entry.overloads.values()
    assert result.library.get_pointer_to_function(result.fndesc.llvm_func_name) == 0
    assert helped(3.0) == 6.0, "a function that a kernel inlines has no entry for Python"


def test_a_function_of_a_user_is_compiled_by_numba_alone() -> None:
    """A plain function of numba works beside kernels, and has its times of compilation."""

    @numba.njit
    def twice(count):
        return 2 * count

    assert twice(21) == 42
    assert twice.get_metadata((intp,))["timers"]["llvm_lock"] > 0.0
