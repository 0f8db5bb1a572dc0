# SPDX-License-Identifier: Apache-2.0
"""The numerical torture test: cases as data, their evaluation, and a table. `make torture` runs it."""
