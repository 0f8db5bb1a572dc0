# SPDX-License-Identifier: Apache-2.0
"""Input of unknown senders: texts, files, numbers and words with limits, and a console for them."""
