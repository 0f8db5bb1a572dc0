# SPDX-License-Identifier: Apache-2.0
"""Where the time of a step goes, and what the machine would allow: ``make profile``."""
