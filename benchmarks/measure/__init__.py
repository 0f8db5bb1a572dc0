# SPDX-License-Identifier: Apache-2.0
"""Measurement of all tables in the pages with one command: ``make measure``."""
