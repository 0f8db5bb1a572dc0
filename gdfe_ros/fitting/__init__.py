# SPDX-License-Identifier: Apache-2.0
"""Fits to measurements: material laws from tensile tests, parameters of scenes from recordings of a robot."""
