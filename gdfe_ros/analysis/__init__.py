# SPDX-License-Identifier: Apache-2.0
"""Pictures, files and reports made from results."""
