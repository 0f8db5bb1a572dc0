# SPDX-License-Identifier: Apache-2.0
"""What a step results in: its numbers, contacts, fields of the elements, and readings of inertial units."""
