# SPDX-License-Identifier: Apache-2.0
"""Inverse control: from where probes are to be to commands of actuators."""

from gdfe_ros.control.inverse import InverseControl, Reach, Target

__all__ = ["InverseControl", "Reach", "Target"]
