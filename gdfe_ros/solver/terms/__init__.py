# SPDX-License-Identifier: Apache-2.0
"""Terms of the potential beside the elements: cables, chambers, dead loads, growth, and user-defined terms."""
