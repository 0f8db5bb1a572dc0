# SPDX-License-Identifier: Apache-2.0
"""The numerical torture test: cases as data, a judge, a table. `make torture` runs it."""
