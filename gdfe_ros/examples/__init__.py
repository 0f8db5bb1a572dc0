# SPDX-License-Identifier: Apache-2.0
"""Controllers and compositions to start from; each runs as a node and in a test."""
