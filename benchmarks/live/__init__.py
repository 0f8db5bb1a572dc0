# SPDX-License-Identifier: Apache-2.0
"""What the live page does in a real browser, and with many viewers."""
