# SPDX-License-Identifier: Apache-2.0
"""The key `self_contact` of a scene: what is read, and what is refused by name."""

from __future__ import annotations

import pytest

from gdfe_ros import Simulation
from gdfe_ros.constraints.self_contact import NAME
from gdfe_ros.contacts import contact_names
from gdfe_ros.errors import SceneError
from gdfe_ros.scene import scene_from_text


def test_all_of_the_surface_takes_part_or_what_is_chosen(sound: str) -> None:
    """Without `where` every boundary face may touch, with it those that lie there; without the key there is nothing."""
    whole = scene_from_text(sound + "self_contact: {friction: 0.5}").self_contact
    part = scene_from_text(sound + "self_contact: {where: {face: z+}}").self_contact
    assert (len(whole.quads), whole.friction, len(part.quads), part.friction) == (40, 0.5, 8, 0.0)
    assert scene_from_text(sound).self_contact is None
    assert NAME not in Simulation(scene_from_text(sound)).step().contacts


def test_the_body_is_the_last_of_the_names(sound: str) -> None:
    """Contacts of the body with itself have their name behind all others, in results and on topics."""
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
    """A coefficient below zero, an unknown key, a place without faces, an empty entry: each is refused with remedy."""
    with pytest.raises(SceneError, match=f"(?s){said}"):
        scene_from_text(f"{sound}self_contact: {given}")


def test_no_newtons_no_contact(sound: str) -> None:
    """The policy that knows no forces refuses it."""
    with pytest.raises(SceneError, match="the policy 'relative' has no forces and cannot take self_contact"):
        scene_from_text(sound.replace("policy: energy", "policy: relative") + "self_contact: {}")
