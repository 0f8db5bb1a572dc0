# SPDX-License-Identifier: Apache-2.0
"""The table of the material library in docs/fitting.md, made from the library."""

from __future__ import annotations

from benchmarks.markdown import markdown_table
from gdfe_ros.materials import LIBRARY
from gdfe_ros.materials.published import PUBLISHED

_HEAD = (
    "preset",
    "Ogden: mu [kPa]; alpha",
    "largest deviation from the measured points",
    "largest measured strain",
    "Poisson's ratio",
    "density [kg/m^3]",
    "source",
)


def library_table() -> str:
    """Return the Markdown table with a row for each material."""
    rows = []
    for name, recipe in LIBRARY.items():
        constants = [", ".join(f"{value:.4g}" for value in numbers) for numbers in
                     ([1e-3 * mu for mu in recipe.mu], recipe.alpha)]  # fmt: skip
        misfit = "" if recipe.misfit is None else f"{100.0 * recipe.misfit:.2g} %"
        told = [f"{value:g}" if value is not None else "unknown" for value in (recipe.poisson, recipe.density)]
        rows.append([f"`{name}`", "; ".join(constants), misfit, f"{recipe.curve.strain_max:g}", *told, recipe.source])
    return markdown_table(_HEAD, rows)


def published_table() -> str:
    """Return the Markdown table with a row for each published set."""
    rows = []
    for name, item in PUBLISHED.items():
        law = item.law
        keys = [*type(law).parameters()]
        numbers = [f"{key} {_text(getattr(law, key))}" for key in keys]
        kind = f"`{law.law.name.lower()}`: {', '.join(numbers)}"
        rows.append([f"`{name}`", kind, f"{1e-3 * law.shear0:.4g}", item.strain, item.kind, item.reference])
    head = ("published", "law, constants in Pa", "initial shear modulus [kPa]", "range of strain", "test", "reference")
    return markdown_table(head, rows)


def _text(value: float | tuple[float, ...]) -> str:
    return ", ".join(f"{each:.6g}" for each in value) if isinstance(value, tuple) else f"{value:.6g}"
