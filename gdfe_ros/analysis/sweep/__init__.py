# SPDX-License-Identifier: Apache-2.0
"""Sweeps: one scene solved with many overrides, in parallel."""
