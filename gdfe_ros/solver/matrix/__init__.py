# SPDX-License-Identifier: Apache-2.0
"""The unknowns of a body, and its constant matrix, the initial Hessian of every minimisation."""
