# SPDX-License-Identifier: Apache-2.0
"""Loading of scenes from a file, a name or a text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any, get_origin

import numpy as np
from pydantic import ValidationError

from gdfe_ros.arms.arm import Arm
from gdfe_ros.constraints import Handle
from gdfe_ros.errors import SceneError
from gdfe_ros.installation import share_dir
from gdfe_ros.scene.building.actuators import build_actuators, build_loads, build_masses, build_probes
from gdfe_ros.scene.building.arms import build_arms, require_arms
from gdfe_ros.scene.building.builder import (
    assign_materials,
    build_handles,
    build_materials,
    require_held,
    require_own_names,
)
from gdfe_ros.scene.building.fibre_layers import build_fibres
from gdfe_ros.scene.building.simulated_mesh import build_mesh, require_body
from gdfe_ros.scene.building.soft_bodies import assign_soft_materials, build_soft_bodies, with_soft_bodies
from gdfe_ros.scene.building.touchable import build_bodies, build_obstacles, build_self_contact, build_sensors
from gdfe_ros.scene.building.tracks import build_program
from gdfe_ros.scene.document import Carried, Document, KeyPath, parse_document, write_document
from gdfe_ros.scene.override import apply_override
from gdfe_ros.scene.program import Program
from gdfe_ros.scene.report import Defects, bare
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.schemas.paths import missing_packages
from gdfe_ros.scene.schemas.scene_schema import Draft, SceneModel
from gdfe_ros.scene.solvable import unsolvable
from gdfe_ros.untrusted.bounded_text import LARGEST_TEXT
from gdfe_ros.untrusted.regular_file import defect_of, is_file, read_text
from gdfe_ros.untrusted.spelling import closest

_SUFFIXES = (".yaml", ".yml")


def scene_names() -> list[str]:
    """Return the names of the scenes in ``config/scenes``, sorted."""
    return sorted(path.stem for path in _scenes_dir().glob("*.yaml"))


def loadable_names() -> list[str]:
    """Return the names of the scenes in ``config/scenes`` whose robots are installed, sorted."""
    texts = {name: (_scenes_dir() / f"{name}.yaml").read_text(encoding="utf-8") for name in scene_names()}
    return [name for name, text in texts.items() if not missing_packages(text)]


def load_scene(name_or_path: str | Path, *, overrides: Mapping[str, Any] | None = None) -> Scene:
    """Load and validate a scene.

    Args:
        name_or_path: name of a scene in ``config/scenes`` (``bend5``), or path of a YAML file.
        overrides: dict from dotted key to value, applied before validation:
            ``{"materials.soft.poisson": 0.49, "program.handles.tip.1.time": 2.0}``; strings are read as YAML.

    Returns:
        The scene.

    Raises:
        SceneError: the scene does not exist, or has defects; the error names every defect.

    Example:
        >>> load_scene("bend5", overrides={"mesh.bar.cells": [25, 2, 2]}).mesh.n_cells
        100
    """
    path = _find(name_or_path)
    heading = f"scene {path}"
    try:
        text = read_text(path, most=LARGEST_TEXT)
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(heading, [f"cannot be read as text: {error}; a scene is a YAML file"]) from error
    return _scene(text, heading, path, overrides)


def scene_from_text(text: str, *, origin: str = "<text>", overrides: Mapping[str, Any] | None = None) -> Scene:
    """Return a scene from YAML text, e.g. from `Scene.source` or a bag.

    Args:
        text: the YAML text; it may not refer to other files by relative paths.
        origin: name of the text in errors.
        overrides: as for `load_scene`.

    Raises:
        SceneError: the text has defects; the error names every defect.
    """
    return _scene(text, f"scene {origin}", None, overrides)


def _document(text: str, heading: str, overrides: Mapping[str, Any] | None) -> tuple[Document, Defects]:
    """Return the document of a text with the overrides applied, and a report with the defects found so far."""
    document = parse_document(text, heading=heading)
    report = Defects(heading, document)
    overrides = overrides or {}
    if not isinstance(overrides, Mapping) or not all(isinstance(key, str) for key in overrides):
        text = f"overrides = {overrides!r}: allowed is a dict from dotted key to value, {{'mesh.bar.cells': [9, 2, 2]}}"
        raise SceneError(heading, [text])
    for key, without in (("dynamics", "equilibria"), ("self_contact", "surfaces that pass through each other")):
        if document.data.get(key, {}) is None:
            report.add((key,), f"it is empty; write {{}} for the defaults, or leave it out for {without}")
    for key, value in overrides.items():
        apply_override(document, key, value, report)
    require_body(document.data, report)
    require_arms(document.data, report)
    return document, report


def _scene(text: str, heading: str, path: Path | None, overrides: Mapping[str, Any] | None) -> Scene:
    document, report = _document(text, heading, overrides)
    draft = _validate(document, report, path.parent if path else None)
    require_own_names(draft, report)
    carried: Carried = {}
    mesh = build_mesh(draft, carried, report)
    materials = build_materials(draft, carried, report)
    cell_material = assign_materials(draft, mesh, report)
    handles = build_handles(draft, mesh, report)
    still = draft.dynamics is None and not report.concerns("dynamics")
    if mesh is not None and len(handles) == len(report.names("handles")) and still:
        require_held(mesh, handles, report)
    guests = build_soft_bodies(draft, mesh, carried, report)
    whole = with_soft_bodies(mesh, guests)
    cell_material = np.concatenate([cell_material, assign_soft_materials(draft, guests, report)])
    rigid = build_bodies(draft, whole, carried, report)
    handles = (*handles, *build_obstacles(draft, mesh, carried, report), *rigid)
    arms = build_arms(draft, mesh, handles, carried, report)
    handles = _on_arms(handles, arms)
    probes = build_probes(draft, mesh, report)
    masses = (*build_masses(draft, mesh, probes, report), *(item.attached for item in rigid))
    scene = Scene(
        name=document.data.get("name", ""),
        description=document.data.get("description", ""),
        mesh=whole,
        materials=materials,
        cell_material=cell_material,
        handles=handles,
        solver=draft.solver,
        path=path,
        actuators=build_actuators(draft, mesh, handles, report),
        loads=build_loads(draft, mesh, whole, materials, cell_material, masses, report),
        probes=probes,
        sensors=build_sensors(draft, mesh, report),
        masses=masses,
        self_contact=build_self_contact(draft, mesh, whole, report),
        dynamics=draft.dynamics,
        fibres=build_fibres(draft, mesh, materials, report),
        arms=arms,
        soft_bodies=tuple(guests),
    )
    if draft.program is not None:
        scene = replace(scene, program=build_program(draft, scene, report))
    sound = not (cell_material < 0).any() and len(materials) == len(report.names("materials"))
    _report_conflicts(scene if sound else replace(scene, cell_material=cell_material[:0]), report)
    report.raise_if_any()
    for (*parents, last), entry in carried.items():
        report.value_at(tuple(parents), plain=False)[last] = entry
    return replace(scene, source=write_document(document.data) if overrides or carried else text)


def _report_conflicts(scene: Scene, report: Defects) -> None:
    """Report conflicts between valid entries, except for conflicts that follow from a defect in another entry."""
    for key, text in unsolvable(scene, scene.solver.policy):
        of_skin = key[-1] == "cells" and report.concerns("skin")
        if not of_skin and not (key == ("bodies",) and report.concerns("dynamics")):
            report.refuse(key, text)


def _on_arms(handles: Sequence[Handle], arms: Sequence[Arm]) -> tuple[Handle, ...]:
    """Add the name of the carrying arm to handles on arms; return all handles, and the links of arms as obstacles."""
    carriers = {arm.handle: arm.name for arm in arms}
    carried = (replace(each, carrier=carriers[each.name]) if each.name in carriers else each for each in handles)
    return (*carried, *(piece for arm in arms for piece in arm.links))


def _validate(document: Document, report: Defects, folder: Path | None) -> SceneModel:
    context = {"folder": folder}
    try:
        return SceneModel.model_validate(document.data, context=context)
    except ValidationError as error:
        broken = report.add_invalid(error)
        return Draft.model_validate(_prune(document.data, broken), context=context)


def _prune(data: dict[str, Any], broken: list[KeyPath]) -> dict[str, Any]:
    """Return a copy of the data without the defective entries at the key paths ``broken``.

    The remaining entries can then be checked against each other.
    """
    sound = deepcopy({key: value for key, value in data.items() if key in Draft.model_fields})
    for path in broken:
        *parents, last = path[: _depth(path)]
        within = sound
        for part in parents:
            within = within.get(part, {})
        if isinstance(within, list):
            within[last] = None
        else:
            within.pop(last, None)
    return sound


def _depth(path: KeyPath) -> int:
    """Return how many keys of a path to keep so that they lead to the smallest entry that can be dropped as a whole.

    Such an entry is an item of a section, such as one handle, or a section without items.
    """
    kind, above = (Program, 1) if path[0] == "program" and len(path) > 1 else (SceneModel, 0)
    field = kind.model_fields.get(path[above])
    section = field is not None and get_origin(bare(field.annotation)) in (dict, tuple)
    return above + 2 if section else 1


def _scenes_dir() -> Path:
    return share_dir() / "config" / "scenes"


def _find(name_or_path: str | Path) -> Path:
    path = Path(name_or_path).expanduser()
    if isinstance(name_or_path, str) and path.suffix not in _SUFFIXES and len(path.parts) == 1:
        named = _scenes_dir() / f"{name_or_path}.yaml"
        path = named if is_file(named) else path
    if is_file(path):
        return path
    if defect := defect_of(path):
        raise SceneError(f"scene {str(path)[:80]}...", [f"no file can have this path: {defect}"])
    if path.is_symlink() and not path.exists():
        raise SceneError(f"scene {path}", [f"it is a link to {path.readlink()}, which leads to no file"])
    names, files = scene_names(), {file.stem: str(file) for file in path.parent.glob("*.y*ml")}
    word = closest(path.stem, [*files, *names])
    hint = f"did you mean {files.get(word, word)!r}? " if word is not None else ""
    kind = "is a directory, not a scene file" if path.is_dir() else "does not exist"
    raise SceneError(f"scene {name_or_path}", [f"{kind}; {hint}scenes: {', '.join(names)}, or the path of a YAML file"])
