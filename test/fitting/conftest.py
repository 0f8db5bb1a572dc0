# SPDX-License-Identifier: Apache-2.0
"""Small scenes that are solved in milliseconds."""
