# SPDX-License-Identifier: Apache-2.0
"""All tables of the pages anew, with one command: ``make measure``."""
