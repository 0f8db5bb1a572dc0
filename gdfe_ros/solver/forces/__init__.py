# SPDX-License-Identifier: Apache-2.0
"""Forces on a body: its external terms, grips, pressures of the elements, and reactions of handles and obstacles."""
