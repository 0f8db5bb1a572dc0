# SPDX-License-Identifier: Apache-2.0
"""Contact terms: gaps and Coulomb friction of the body's surface with obstacles, rigid bodies and itself."""
