# SPDX-License-Identifier: Apache-2.0
"""The solver: elements, terms, matrices, minimisation, equilibria and motion. It imports no ROS and reads no files."""
