# SPDX-License-Identifier: Apache-2.0
"""Terms of the potential other than the elements: cables, chambers, dead loads, growth, and user-defined terms."""
