# SPDX-License-Identifier: Apache-2.0
"""Forces and pressures of a scene: all its terms together, grips, reactions of handles, and fields of elements."""
