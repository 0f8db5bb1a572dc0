# SPDX-License-Identifier: Apache-2.0
"""A scene with many overrides, in parallel."""
