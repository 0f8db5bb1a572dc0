# SPDX-License-Identifier: Apache-2.0
"""Meshes from closed surfaces and CAD files, and checks of these files before they are filled with cells."""
