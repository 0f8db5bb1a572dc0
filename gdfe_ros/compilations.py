# SPDX-License-Identifier: Apache-2.0
"""The number of kernels that this process compiles, for the line that a waiting user sees. It imports no numba."""

from __future__ import annotations

ONCE = "compiling kernels, once for this machine"


class Compilations:
    """Counter of the kernels that a process compiled.

    Attributes:
        compiled: number of kernels that are compiled.
        running: number of compilations that have begun and not ended; a kernel waits for those that it calls.
    """

    def __init__(self) -> None:
        self.compiled, self.running = 0, 0

    def text(self) -> str | None:
        """Return a line about the compilation that is running, or None."""
        if not self.running:
            return None
        return f"{ONCE}: {self.compiled} of at least {self.compiled + self.running}"


compilations = Compilations()
"""Those of this process."""
