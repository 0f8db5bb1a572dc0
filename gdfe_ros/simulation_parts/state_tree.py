# SPDX-License-Identifier: Apache-2.0
"""The state of a simulation as a tree of plain values and arrays, which contain no code; archives store it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import ActuatorState, Mode
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError
from gdfe_ros.solver.elements.blocks import Operators
from gdfe_ros.solver.matrix.tangent_assembly import Tangent
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.state import (
    Balance,
    Bound,
    ElementState,
    Failure,
    Ledger,
    Motion,
    ShapeState,
    Snapshot,
    State,
    Summary,
    Unfinished,
    replace_fields,
)
from gdfe_ros.solver.stepping.stepper import Stepper

_VALUES = (
    Bound,
    Failure,
    Ledger,
    Balance,
    ElementState,
    Motion,
    ShapeState,
    Snapshot,
    State,
    Summary,
    Unfinished,
    ActuatorState,
    Pose,
    Tangent,
)
_CLASSES = {kind.__name__: kind for kind in _VALUES}
"""Dict from name to a dataclass that a tree may contain."""


class TreeError(ValueError):
    """Error: a tree was not written by this package, or a value is not part of a state."""


def to_tree(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return a value as a tree of JSON types; each of its arrays is added to ``arrays`` once.

    Raises:
        TreeError: the value is not part of a state.
    """
    if value is None or (isinstance(value, (bool, int, float, str)) and not isinstance(value, Enum)):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        name = next((name for name, array in arrays.items() if array is value), f"a{len(arrays)}")
        arrays[name] = value
        return {"array": name}
    if isinstance(value, Mode):
        return {"mode": value.value}
    if isinstance(value, Mapping):
        return {"mapping": {key: to_tree(item, arrays) for key, item in value.items()}}
    if isinstance(value, tuple):
        return {"tuple": [to_tree(item, arrays) for item in value]}
    if is_dataclass(value) and type(value).__name__ in _CLASSES:
        entries = {item.name: getattr(value, item.name) for item in fields(value)}
        kept = {name: to_tree(item, arrays) for name, item in entries.items() if not isinstance(item, Operators)}
        return {"class": type(value).__name__, "fields": kept}
    raise TreeError(f"a {type(value).__name__} is not part of a state")


def from_tree(tree: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Return the value of a tree. `State.operators` is None: `complete` computes it from the commands.

    Raises:
        TreeError: the tree was not written by `to_tree`.
    """
    if tree is None or isinstance(tree, (bool, int, float, str)):
        return tree
    if not isinstance(tree, dict) or len(tree) not in (1, 2):
        raise TreeError(f"{str(tree)[:60]!r} is not part of a state")
    if "array" in tree:
        return arrays[tree["array"]]
    if "mode" in tree:
        return Mode(tree["mode"])
    if "mapping" in tree:
        return {key: from_tree(item, arrays) for key, item in tree["mapping"].items()}
    if "tuple" in tree:
        return tuple(from_tree(item, arrays) for item in tree["tuple"])
    if tree.get("class") not in _CLASSES:
        raise TreeError(f"{str(tree)[:60]!r} is not part of a state")
    return _instance(tree, arrays)


def _instance(tree: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Return the dataclass of a tree with the keys ``class`` and ``fields``."""
    kind = _CLASSES[tree["class"]]
    given = {name: from_tree(item, arrays) for name, item in tree["fields"].items()}
    names = {item.name for item in fields(kind)} - ({"operators"} if kind is State else set())
    if set(given) != names:
        raise TreeError(f"{kind.__name__} has missing or unknown fields: {sorted(set(given) ^ names)}")
    return kind(**given, operators=None) if kind is State else kind(**given)


def complete(state: State, stepper: Stepper | MotionStepper) -> State:
    """Return a state that was read from an archive, with the operators that follow from its commands.

    A state that converged only to a larger tolerance than that of the stepper is marked as not converged.

    Raises:
        CommandError: the state belongs to another scene: vertices, handles, commands or terms differ.
    """
    own, growths = stepper.at_rest(), stepper.actuation.growths
    for what, one, two in (
        ("vertices", len(state.positions), len(own.positions)),
        ("handles", sorted(state.poses), sorted(own.poses)),
        ("actuators and loads", sorted(state.commands), sorted(own.commands)),
        ("terms", sorted(state.terms), sorted(own.terms)),
    ):
        if one != two:
            raise CommandError(f"the state is one of another scene: its {what} are {one}, here {two}")
    near = state.summary.converged and state.summary.error_estimate <= stepper.settings.tolerance
    return state.with_(
        operators=growths.at(state.commands, growths.ungrown),
        anchor=state.anchor and complete(state.anchor, stepper),
        summary=replace_fields(state.summary, converged=near),
    )
