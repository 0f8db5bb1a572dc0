# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of solves by commands, poses, materials, and the initial state."""
