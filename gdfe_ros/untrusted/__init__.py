# SPDX-License-Identifier: Apache-2.0
"""Input of unknown senders: texts, files and numbers within limits, spelling, and a console that shows texts safely."""
