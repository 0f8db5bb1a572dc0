# SPDX-License-Identifier: Apache-2.0
"""Results of a step: its numbers, contacts, fields of the elements, and readings of inertial units."""
