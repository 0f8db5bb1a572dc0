# SPDX-License-Identifier: Apache-2.0
"""Recorded runs in the formats of other programs."""
