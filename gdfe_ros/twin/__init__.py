# SPDX-License-Identifier: Apache-2.0
"""A simulation beside a real robot: it follows the same commands, is compared with measurements, and fits moduli."""
