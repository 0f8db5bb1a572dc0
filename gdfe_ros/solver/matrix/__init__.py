# SPDX-License-Identifier: Apache-2.0
"""What is unknown about a body, and the constant matrix that every direction of a descent starts from."""
