# SPDX-License-Identifier: Apache-2.0
"""The key `self_contact` of a scene: accepted values, and refused ones."""

from __future__ import annotations

import pytest

from gdfe_ros import Simulation
from gdfe_ros.constraints.obstacle import NAME
from gdfe_ros.errors import SceneError
from gdfe_ros.results.contacts import contact_names
from gdfe_ros.scene import scene_from_text


def test_all_of_the_surface_takes_part_or_what_is_chosen(sound: str) -> None:
    """Without `where` every boundary face can touch, with it those inside; without the key none."""
    whole = scene_from_text(sound + "self_contact: {friction: 0.5}").self_contact
    part = scene_from_text(sound + "self_contact: {where: {face: z+}}").self_contact
    assert (len(whole.quads), whole.friction, len(part.quads), part.friction) == (40, 0.5, 8, 0.0)
    assert scene_from_text(sound).self_contact is None
    assert NAME not in Simulation(scene_from_text(sound)).step().contacts


def test_the_body_is_the_last_of_the_names(sound: str) -> None:
    """Self-contact is named after all other contacts, in results and on topics."""
    text = sound + "self_contact: {}\nobstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -1]}}"
    scene = scene_from_text(text)
    assert (
        contact_names(scene.handles, scene.self_contact) == ["floor", NAME] == list(Simulation(scene).step().contacts)
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("{friction: -0.1}", r"self_contact\.friction.*-0\.1"),
        ("{friction: rough}", r"self_contact\.friction"),
        ("{frictoin: 0.1}", r"frictoin.*friction"),
        ("{where: {box: {x: [1, 2]}}}", "no boundary face is there; the mesh spans x 0 to 0.2"),
        ("{where: {set: skin}}", "skin"),
        ("", "it is empty; write {} for the defaults, or leave it out for surfaces that pass through each other"),
    ],
)
def test_bad_input_is_named(sound: str, given: str, said: str) -> None:
    """A negative coefficient, an unknown key, a place without faces, and an empty entry are refused with a remedy."""
    with pytest.raises(SceneError, match=f"(?s){said}"):
        scene_from_text(f"{sound}self_contact: {given}")


def test_no_newtons_no_contact(sound: str) -> None:
    """The policy relative, which has no forces, refuses self-contact."""
    with pytest.raises(SceneError, match=r"the policy 'relative' has no forces.*cannot take self_contact"):
        scene_from_text(sound.replace("policy: energy", "policy: relative") + "self_contact: {}")
