# SPDX-License-Identifier: Apache-2.0
"""The measured pneumatic arm: its mesh, its scene, and what a fit to low pressures foretells of high ones."""
