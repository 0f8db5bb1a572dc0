# SPDX-License-Identifier: Apache-2.0
"""Copies of parts of flat vectors, for kernels.

An assignment of slices in a kernel has a test of their shapes, with a message made of text: a tenth of a second to
compile for each of them.
"""

from __future__ import annotations

from gdfe_ros.compiled import inlined


@inlined
def copy_part(target, to, source, at, count):
    """Copy ``count`` numbers of ``source`` from ``at`` on to ``target`` from ``to`` on."""
    for i in range(count):
        target[to + i] = source[at + i]


@inlined
def clear_part(target, to, count):
    """Set ``count`` numbers of ``target`` from ``to`` on to zero."""
    for i in range(count):
        target[to + i] = 0.0
