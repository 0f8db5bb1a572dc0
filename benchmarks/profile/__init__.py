# SPDX-License-Identifier: Apache-2.0
"""Times of the phases of a step, compared with the limits of the machine: ``make profile``."""
