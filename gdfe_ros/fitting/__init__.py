# SPDX-License-Identifier: Apache-2.0
"""From measurements to models: laws from tensile tests, scenes from recordings of a robot."""
