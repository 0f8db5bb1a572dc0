# SPDX-License-Identifier: Apache-2.0
"""Files of meshes and surfaces: their formats, their cache, and the process that reads and meshes them."""
