# SPDX-License-Identifier: Apache-2.0
"""Soft robots and rubbers that others have measured, and the predictions of this solver."""

from pathlib import Path

ROBOTS = Path(__file__).parents[2] / "test" / "data" / "measured" / "robots"
"""Folder of the measured data."""
