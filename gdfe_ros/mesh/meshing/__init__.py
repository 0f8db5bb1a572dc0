# SPDX-License-Identifier: Apache-2.0
"""Meshes from closed surfaces and CAD files, and checks of what is to be filled."""
