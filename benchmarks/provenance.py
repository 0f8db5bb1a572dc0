# SPDX-License-Identifier: Apache-2.0
"""Provenance of a table: version of the solver, date and machine."""

from __future__ import annotations

import ast
import hashlib
import io
import subprocess
import tarfile
from dataclasses import dataclass
from datetime import date
from functools import cache
from pathlib import Path

from gdfe_ros.recording.provenance import describe_machine

ROOT = Path(__file__).resolve().parents[1]
SOLVER = ("gdfe_ros", "config")
"""Folders whose last commit identifies the solver: the package and its scenes."""
LOOKS = "gdfe_ros/analysis"
"""Folder of the package without influence on any figure of a table: pictures, reports, replays."""
DIRTY = "+"
"""Suffix of the commit if `SOLVER` has changes that are not committed."""


class ProvenanceError(RuntimeError):
    """The version of the solver cannot be found with git."""


@dataclass(frozen=True)
class Provenance:
    """Provenance of a table.

    Attributes:
        commit: last commit that changed `SOLVER`, abbreviated, with the suffix `DIRTY` if files were changed since.
        date: day of the measurement, ISO 8601.
        machine: processor, cores, versions of Python and numba.
    """

    commit: str
    date: str
    machine: str

    @property
    def line(self) -> str:
        """Line of Markdown that is printed below a table."""
        return f"*Measured {self.date} at {self.commit} on {self.machine}.*"

    @property
    def is_current(self) -> bool:
        """Whether the present code, without docstrings and comments, made the table; False for uncommitted changes."""
        now = solver_commit()
        if DIRTY in (self.commit[-1], now[-1]):
            return False
        return self.commit == now or code_digest(self.commit) == code_digest(now)


def stamp() -> Provenance:
    """Return the provenance of a measurement that is made now.

    Raises:
        ProvenanceError: git is missing, or this is no checkout.
    """
    return Provenance(solver_commit(), date.today().isoformat(), machine())


@cache
def solver_commit() -> str:
    """Return the commit of the solver in the form of `Provenance.commit`; git is called once per process.

    Raises:
        ProvenanceError: git is missing, or this is no checkout.
    """
    folders = (*SOLVER, f":(exclude){LOOKS}")
    commit = _git("log", "-1", "--format=%h", "--abbrev=7", "--", *folders)
    changed = _git("status", "--porcelain", "--", *folders)
    return commit + DIRTY if changed else commit


@cache
def code_digest(commit: str) -> str:
    """Return a digest of `SOLVER` at a commit, without docstrings and comments; empty if there is no such commit."""
    try:
        archive = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return ""
    digest = hashlib.sha256()
    with tarfile.open(fileobj=io.BytesIO(archive)) as tree:
        for item in sorted(tree.getmembers(), key=lambda item: item.name):
            if item.isfile() and item.name.startswith(SOLVER) and not item.name.startswith(LOOKS):
                content = tree.extractfile(item).read()
                if item.name.endswith(".py"):
                    content = ast.dump(_WithoutConstants().visit(ast.parse(content))).encode()
                digest.update(item.name.encode() + content)
    return digest.hexdigest()


class _WithoutConstants(ast.NodeTransformer):
    """Removes statements that are constants, i.e. docstrings."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        return None if isinstance(node.value, ast.Constant) else node


def machine() -> str:
    """Return processor, cores, and versions of Python and numba."""
    facts = describe_machine()
    cores = int(facts["cores"])
    return f"{facts['processor']}, {cores} core{'s' * (cores > 1)}, Python {facts['python']}, numba {facts['numba']}"


def _git(*words: str) -> str:
    try:
        found = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        reason = getattr(error, "stderr", "") or str(error)
        raise ProvenanceError(
            f"cannot tell the solver's commit in {ROOT}: git {words[0]}: {reason.strip()}; measure in a git checkout"
        ) from error
    return found.stdout.strip()
