# SPDX-License-Identifier: Apache-2.0
"""Example controllers and compositions of nodes; each runs as a node or program, and in a test."""
