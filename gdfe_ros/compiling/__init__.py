# SPDX-License-Identifier: Apache-2.0
"""Compilation of kernels: once for this machine, linked by address, and quicker than by numba alone."""
