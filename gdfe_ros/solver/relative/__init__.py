# SPDX-License-Identifier: Apache-2.0
"""The policy ``relative``: the paper's shape factors and desired shapes, as published."""
