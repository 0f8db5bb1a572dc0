# SPDX-License-Identifier: Apache-2.0
"""One table of before and after for the solver's loop: run times of two commits in turn, and true errors of both."""
