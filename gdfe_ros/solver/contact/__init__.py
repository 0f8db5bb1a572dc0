# SPDX-License-Identifier: Apache-2.0
"""Contact as terms: gaps between points of the body's surface and rigid obstacles, and friction there."""
