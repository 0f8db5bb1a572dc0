# SPDX-License-Identifier: Apache-2.0
"""Construction of a scene from the valid parts of its file, with checks between them."""
