# SPDX-License-Identifier: Apache-2.0
"""Bodies under test, as for the solver."""

from test.solver.conftest import end, law, make_body

__all__ = ["end", "law", "make_body"]
