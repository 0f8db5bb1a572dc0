# SPDX-License-Identifier: Apache-2.0
"""Loading of scenes from a file, a name or a text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from gdfe_ros.actuators import Actuator, Load
from gdfe_ros.arms.arm import Arm
from gdfe_ros.bounded_text import LARGEST_TEXT
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.form import TriangleMesh
from gdfe_ros.constraints.obstacle import ArmLink, Obstacle
from gdfe_ros.errors import SceneError
from gdfe_ros.regular_file import defect_of, is_file, read_text
from gdfe_ros.scene.actuation import build_actuators, build_loads, build_masses, build_probes, neutral_commands
from gdfe_ros.scene.arms import build_arms, joint_starts, require_arms
from gdfe_ros.scene.builder import assign_materials, build_handles, build_materials, build_program, require_held
from gdfe_ros.scene.document import Document, KeyPath, parse_document, write_document
from gdfe_ros.scene.fibres import build_fibres
from gdfe_ros.scene.meshes import Carried, build_mesh, require_body
from gdfe_ros.scene.override import apply_override
from gdfe_ros.scene.paths import missing_packages
from gdfe_ros.scene.program import Program
from gdfe_ros.scene.report import NO_VALUE, Defects
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.schema import Draft, SceneModel
from gdfe_ros.scene.soft_bodies import assign_soft_materials, build_soft_bodies, with_soft_bodies
from gdfe_ros.scene.solvable import unsolvable
from gdfe_ros.scene.touchable import build_bodies, build_obstacles, build_self_contact, build_sensors
from gdfe_ros.share import share_dir
from gdfe_ros.spelling import closest

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


_SECTIONS = (
    "arms", "meshes", "soft_bodies", "materials", "regions", "handles", "obstacles", "bodies", "actuators", "loads",
    "masses", "fibres", "probes", "sensors",
)  # fmt: skip


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
    mesh, carried = build_mesh(draft, _names(document, "meshes"), report)
    materials = build_materials(draft, report)
    cell_material = assign_materials(draft, mesh, _names(document, "materials"), report)
    handles = build_handles(draft, mesh, report)
    still = draft.dynamics is None and not report.concerns("dynamics")
    if mesh is not None and len(handles) == len(_names(document, "handles")) and still:
        require_held(mesh, handles, report)
    guests = build_soft_bodies(draft, mesh, carried, report)
    whole = with_soft_bodies(mesh, guests)
    own = assign_soft_materials(draft, guests, _names(document, "materials"), report)
    cell_material = np.concatenate([cell_material, own])
    rigid = build_bodies(draft, whole, report)
    handles = (*handles, *build_obstacles(draft, mesh, report), *rigid)
    arms, robots = build_arms(draft, mesh, handles, report)
    carried |= robots
    handles = _on_arms(handles, arms)
    actuators = build_actuators(draft, mesh, handles, report)
    probes = build_probes(draft, mesh, report)
    attached = build_masses(draft, mesh, probes, _names(document, "probes"), report)
    masses = (*attached, *(item.attached for item in rigid))
    loads = build_loads(draft, mesh, whole, materials, cell_material, masses, report)
    sensors = build_sensors(draft, mesh, report)
    self_contact = build_self_contact(draft, mesh, whole, report)
    fibres = build_fibres(draft, mesh, materials, report)
    program = None
    if draft.program is not None:
        start = neutral_commands(mesh, actuators, loads) if mesh is not None else {}
        start |= joint_starts(arms)
        program = _program(document, draft, report, actuators=actuators, loads=loads, arms=arms, start=start)
    solver, dynamics = draft.solver.build(), draft.dynamics.build() if draft.dynamics is not None else None
    scene = Scene(
        name=document.data.get("name", ""),
        description=document.data.get("description", ""),
        mesh=whole,
        materials=materials,
        cell_material=cell_material,
        handles=handles,
        program=program,
        solver=solver,
        path=path,
        actuators=actuators,
        loads=loads,
        probes=probes,
        sensors=sensors,
        masses=masses,
        self_contact=self_contact,
        dynamics=dynamics,
        fibres=fibres,
        arms=arms,
        soft_bodies=tuple(guests),
    )
    sound = not (cell_material < 0).any() and len(materials) == len(_names(document, "materials"))
    _report_conflicts(scene if sound else replace(scene, cell_material=cell_material[:0]), report)
    report.raise_if_any()
    return replace(scene, source=_source(text, document.data, draft, carried, handles, changed=bool(overrides)))


def _report_conflicts(scene: Scene, report: Defects) -> None:
    """Report conflicts between the entries, except for those that follow from a defect in another entry."""
    for key, text in unsolvable(scene, scene.solver.policy):
        of_skin = key[-1] == "cells" and report.concerns("skin")
        if not of_skin and not (key == ("bodies",) and report.concerns("dynamics")):
            report.add(key, text, value=NO_VALUE)


def _program(
    document: Document,
    draft: Draft,
    report: Defects,
    *,
    actuators: Sequence[Actuator],
    loads: Sequence[Load],
    arms: Sequence[Arm],
    start: Mapping[str, float],
) -> Program:
    """Return the program of a draft; ``start`` are the commands before it. Joints are checked if no arm has defects."""
    complete = len(arms) == len(_names(document, "arms")) + ("arm" in document.data)
    driven = {"actuators": actuators, "loads": loads, "start": start, "arms": arms if complete else None}
    named = {section: _names(document, section) for section in ("handles", "obstacles", "actuators", "loads")}
    return build_program(draft.program, draft, named, report, **driven)


def _on_arms(handles: Sequence[Handle], arms: Sequence[Arm]) -> tuple[Handle, ...]:
    """Return the handles, each with the name of the arm that carries it, and the links of the arms as obstacles."""
    carriers = {arm.handle: arm.name for arm in arms}
    carried = (replace(each, carrier=carriers[each.name]) if each.name in carriers else each for each in handles)
    return (*carried, *(piece for arm in arms for piece in arm.links))


def _validate(document: Document, report: Defects, folder: Path | None) -> Draft:
    context = {"folder": folder}
    try:
        model = SceneModel.model_validate(document.data, context=context)
    except ValidationError as error:
        broken = report.add_invalid(error)
        return Draft.model_validate(_prune(document.data, broken), context=context)
    return Draft.model_construct(**{name: getattr(model, name) for name in Draft.model_fields})


def _prune(data: dict[str, Any], broken: list[KeyPath]) -> dict[str, Any]:
    """Return a copy of the data without the defective entries at the key paths ``broken``.

    The remaining entries can then be checked against each other.
    """
    sound = {key: value for key, value in data.items() if key in Draft.model_fields}
    for path in broken:
        _drop(sound, path[: _depth(path)])
    return sound


def _depth(path: KeyPath) -> int:
    if path[0] == "program" and path[1:2] in (("handles",), ("obstacles",), ("actuators",), ("loads",), ("joints",)):
        return 3
    return 2 if path[0] in _SECTIONS else 1


def _drop(container: Any, path: KeyPath) -> None:
    *parents, last = path
    for part in parents:
        if isinstance(container, dict) and part not in container:
            return
        container[part] = copy(container[part])
        container = container[part]
    if isinstance(container, list):
        container[last] = None
    else:
        container.pop(last, None)


def _names(document: Document, section: str) -> list[str]:
    entries = document.data.get(section)
    return [str(name) for name in entries] if isinstance(entries, dict) else []


def _source(
    text: str,
    data: dict[str, Any],
    draft: Draft,
    carried: Carried,
    handles: Sequence[Handle],
    *,
    changed: bool,
) -> str:
    """Return scene text that refers to no other file.

    It is the given text, or YAML of the data if this was ``changed`` or if the contents of files are embedded in it.
    """
    for path, entry in carried.items():
        within = data
        for key in path[:-1]:
            within = within[key]
        if path[0] in ("arm", "arms"):  # the other keys of an arm stay
            kept = {key: value for key, value in within[path[-1]].items() if key not in ("urdf", "packages")}
            entry = kept | entry
        within[path[-1]] = entry
        changed = True
    for handle in handles:
        own = isinstance(handle, Obstacle) and not isinstance(handle, ArmLink)  # the arm's entry has its links' meshes
        if own and isinstance(handle.form, TriangleMesh):
            model = getattr(draft, handle.section)[handle.name]
            data[handle.section][handle.name]["mesh"] = model.mesh.embed(handle.form)
            changed = True
    for name, material in draft.materials.items():
        table = getattr(material, "csv", None)
        if table is not None:
            entry = data["materials"][name]
            entry.pop("csv")
            entry.update(strain=list(table.strain), stress=list(table.stress))
            changed = True
    return write_document(data) if changed else text


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
    names, files = scene_names(), {file.stem: str(file) for file in path.parent.glob("*.y*ml")}
    word = closest(path.stem, [*files, *names])
    hint = f"did you mean {files.get(word, word)!r}? " if word is not None else ""
    kind = "is a directory, not a scene file" if path.is_dir() else "does not exist"
    raise SceneError(f"scene {name_or_path}", [f"{kind}; {hint}scenes: {', '.join(names)}, or the path of a YAML file"])
