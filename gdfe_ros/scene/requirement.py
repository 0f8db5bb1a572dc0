# SPDX-License-Identifier: Apache-2.0
"""Check of pydantic's version before its first use: Ubuntu 24.04's package is too old."""

from __future__ import annotations

from pathlib import Path

import pydantic

from gdfe_ros.errors import DependencyError

if int(pydantic.VERSION.split(".", maxsplit=1)[0]) < 2:
    raise DependencyError(
        f"pydantic {pydantic.VERSION} in {Path(pydantic.__file__).parent} is too old; needed: 2.6 or later. Ubuntu "
        "24.04's python3-pydantic is version 1; install the later one beside it: pip install --user "
        "--break-system-packages 'pydantic>=2.6', or use a virtual environment with --system-site-packages"
    )
