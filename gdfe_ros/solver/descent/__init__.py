# SPDX-License-Identifier: Apache-2.0
"""The minimisation of the potential: L-BFGS on the constant matrix, its workspace, its history, its end."""
