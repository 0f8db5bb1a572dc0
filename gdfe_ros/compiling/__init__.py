# SPDX-License-Identifier: Apache-2.0
"""Compilation of kernels: once per machine, with calls of large kernels by address, and faster than by numba alone."""
