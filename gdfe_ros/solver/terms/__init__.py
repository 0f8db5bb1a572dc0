# SPDX-License-Identifier: Apache-2.0
"""Terms of the potential other than the elements: actuators, loads, layers of fibres, and user-defined terms."""
