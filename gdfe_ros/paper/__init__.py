# SPDX-License-Identifier: Apache-2.0
"""The policy ``relative``: the paper's method as published, and the calibration of its shape factors."""
