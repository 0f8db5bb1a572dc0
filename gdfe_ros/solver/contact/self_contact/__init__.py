# SPDX-License-Identifier: Apache-2.0
"""Contact of a body with itself: pairs of its surface, and the check for penetration."""
