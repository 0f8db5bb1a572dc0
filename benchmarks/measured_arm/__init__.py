# SPDX-License-Identifier: Apache-2.0
"""The measured pneumatic arm: its mesh, its scene, and predictions for high pressures after a fit to low pressures."""
