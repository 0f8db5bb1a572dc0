# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file, checked one by one: meaning, unit, range and default of each."""
