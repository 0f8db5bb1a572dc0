# SPDX-License-Identifier: Apache-2.0
"""Saving and restoring the whole state of a simulation: what follows is the same to the last bit.

A state is everything of the engine that changes: positions, poses, commands, pressures, histories of solver and
predictor. What a scene determines (mesh, operators, factored matrix) is left out and taken from the simulation that
the state is restored into, which must be of the same scene, policy and package version.
"""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import gdfe_ros
from gdfe_ros.errors import GdfeError
from gdfe_ros.simulation import Simulation

_MAGIC = b"gdfe_ros state\n"
_ALLOWED = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy._core.numeric", "_frombuffer"),
    ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "scalar"),
    ("numpy.core.numeric", "_frombuffer"),
    ("collections", "deque"),
    ("collections", "OrderedDict"),
    ("copyreg", "_reconstructor"),
    ("builtins", "object"),
    ("builtins", "set"),
    ("builtins", "frozenset"),
    ("builtins", "slice"),
}
"""What a state may be made of besides this package's own classes; anything else, e.g. in a bag from somebody else, is
refused: unpickling runs what it is told to."""


def save_state(simulation: Simulation) -> bytes:
    """Return the state of a simulation, which does not change."""
    head = json.dumps(_origin(simulation)).encode()
    body = io.BytesIO()
    pickler = pickle.Pickler(body, protocol=5)
    shared = {id(item): key for key, item in _shared(simulation).items()}
    pickler.persistent_id = lambda item: shared.get(id(item))
    pickler.dump((simulation._engine, simulation.time, simulation.targets, simulation.commands, simulation.result))
    return _MAGIC + head + b"\n" + zlib.compress(body.getvalue(), level=1)


def load_state(simulation: Simulation, data: bytes) -> None:
    """Put a simulation into a saved state.

    Raises:
        GdfeError: the data is no state, or one of another scene, policy or version; the simulation is unchanged.
    """
    if not data.startswith(_MAGIC):
        raise GdfeError(f"these {len(data)} bytes are no state; a state is what save_state wrote")
    head, _, body = data[len(_MAGIC) :].partition(b"\n")
    given, own = _head(head), _origin(simulation)
    wrong = [f"its {key} is {given.get(key)}, the simulation's {own[key]}" for key in own if given.get(key) != own[key]]
    if wrong:
        raise GdfeError(f"the state does not fit: {'; '.join(wrong)}")
    try:
        state = _Unpickler(io.BytesIO(zlib.decompress(body)), _shared(simulation)).load()
    except (zlib.error, pickle.UnpicklingError, EOFError, AttributeError, ValueError, TypeError) as error:
        raise GdfeError(f"the state is damaged: {error!r}") from error
    simulation._engine, simulation.time, simulation.targets, simulation.commands, simulation.result = state


def _head(text: bytes) -> dict[str, str]:
    try:
        return dict(json.loads(text))
    except (ValueError, TypeError) as error:
        raise GdfeError(f"the state is damaged: {error!r}") from error


class _Unpickler(pickle.Unpickler):
    def __init__(self, stream: io.BytesIO, shared: Mapping[str, Any]) -> None:
        super().__init__(stream)
        self._shared = shared

    def persistent_load(self, key: str) -> Any:
        if key not in self._shared:
            raise pickle.UnpicklingError(f"unknown part {key!r}")
        return self._shared[key]

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _ALLOWED and module.partition(".")[0] != "gdfe_ros":
            raise pickle.UnpicklingError(f"{module}.{name} is not part of a state")
        found = super().find_class(module, name)
        if module.startswith("gdfe_ros") and not isinstance(found, type):
            raise pickle.UnpicklingError(f"{module}.{name} is not part of a state")
        return found


def _origin(simulation: Simulation) -> dict[str, str]:
    scene = hashlib.sha256(simulation.scene.source.encode()).hexdigest()
    settings = {**asdict(simulation.settings), "policy": simulation.policy.value}
    return {"version": gdfe_ros.__version__, "scene": scene, "settings": json.dumps(settings, sort_keys=True)}


def _shared(simulation: Simulation) -> dict[str, Any]:
    """Name what is the same in every state of a scene."""
    engine, scene = simulation._engine, simulation.scene
    shared = {
        "matrix": engine.equilibrium.matrix,
        "body": engine.body,
        "shape": engine.body.shape,
        "blocks": engine.body.blocks,
        "table": engine.body.table,
        "unknowns": engine.body.unknowns,
        "mesh": scene.mesh,
    }
    for group in (scene.actuators, scene.loads, scene.handles):
        shared.update({f"{type(item).__name__}/{item.name}": item for item in group})
    return shared
