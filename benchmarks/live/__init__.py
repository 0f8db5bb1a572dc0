# SPDX-License-Identifier: Apache-2.0
"""Measurements of the live page: delays and frame rates in a real browser, and its cost with many viewers."""
