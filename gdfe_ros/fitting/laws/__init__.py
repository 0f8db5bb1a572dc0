# SPDX-License-Identifier: Apache-2.0
"""Laws of materials from tensile tests."""
