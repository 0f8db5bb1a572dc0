# SPDX-License-Identifier: Apache-2.0
"""Coupling of arms with yielding joints and the soft body that they carry."""
