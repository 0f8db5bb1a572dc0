# SPDX-License-Identifier: Apache-2.0
"""Arms: chains of rigid links, read from URDF, that carry the handles of a soft body."""
