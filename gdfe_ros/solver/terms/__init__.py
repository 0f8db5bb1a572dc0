# SPDX-License-Identifier: Apache-2.0
"""The terms of the potential beside the elements: cables, chambers, dead loads, growth, and whatever else joins."""
