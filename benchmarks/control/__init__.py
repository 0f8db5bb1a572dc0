# SPDX-License-Identifier: Apache-2.0
"""Inverse control, measured."""
