# SPDX-License-Identifier: Apache-2.0
"""YAML, JSON and XML of strangers: bombs, long numbers and deep nesting are refused at once, and honest texts read."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
import yaml

from gdfe_ros.errors import SceneError
from gdfe_ros.scene.document import parse_document, parse_value
from gdfe_ros.untrusted.bounded_text import MOST_NODES, check_yaml, load_json, load_json_object, load_yaml, parse_xml

BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "\n".join(
    f"{after}: &{after} [{', '.join([f'*{name}'] * 9)}]" for name, after in zip("abcdefgh", "bcdefghi", strict=True)
)
"""Ten lines that stand for 9^9 values."""
MERGES = "a: &a {x: 1, y: 2}\n" + "\n".join(
    f"{after}: &{after} {{<<: [{', '.join([f'*{name}'] * 9)}]}}"
    for name, after in zip("abcdefgh", "bcdefghi", strict=True)
)
_PATIENCE = 5.0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (BOMB, "more than 100000 values"),
        (MERGES, "more than 100000 values"),
        ("a: [" + "1, " * (MOST_NODES + 1) + "]", "more than 100000 values"),
        ("a: " + "1" * 60_000, "has 60000 characters"),
        ("a: -" + "1" * 60_000 + ".5e3", "characters"),
        (f"a: !!int '{'1' * 60_000}'", "has 60000 characters"),
        (f"a: !!float '{'1' * 60_000}'", "has 60000 characters"),
        ("a: " + "1:" * 60_000 + "1", "characters"),
        ("[" * 100_000, "nest"),
        ("\n".join(" " * depth + "a:" for depth in range(100)), "nested deeper"),
        ("a: &a [1]\nb: &b " + "[" * 39 + "*a" + "]" * 39, "nested deeper"),
        ("a: &a [*a]", "contains itself"),
        ("a: *b", "no anchor"),
        ("a: \0", "control characters"),
        ("a: \ud800", "no Unicode"),
    ],
)
def test_a_text_beyond_the_limits_is_refused(text: str, reason: str) -> None:
    """Each text that would take minutes or gigabytes is refused within seconds, with the limit."""
    began = time.process_time()
    with pytest.raises(yaml.YAMLError, match=reason):
        load_yaml(text)
    with pytest.raises(SceneError, match=reason):
        parse_document(text, heading="scene x")
    with pytest.raises(ValueError, match=reason):
        parse_value(text)
    assert time.process_time() - began < _PATIENCE


def test_long_texts_that_are_no_numbers_are_read() -> None:
    """A long text, a quoted number and a word that begins with many digits are text, and are read in linear time."""
    began = time.process_time()
    assert load_yaml(f"a: '{'1' * 100_000}'\nb: {'1' * 100_000}x\nc: {'word ' * 1000}") == {
        "a": "1" * 100_000,
        "b": "1" * 100_000 + "x",
        "c": ("word " * 1000).strip(),
    }
    assert time.process_time() - began < _PATIENCE


@pytest.mark.parametrize(
    "text", ["1e6", "-1.5e-3", ".5e3", "1.e3", "+2E4", "0x1f", "1_000", "1.5", "yes", "~", "2026-11-28", "1:30"]
)
def test_values_are_those_of_yaml(text: str) -> None:
    """Honest values are read as PyYAML's safe loader reads them, and 1e6 as a number."""
    expected = float(text) if "e" in text.lower() and text != "yes" else yaml.safe_load(text)
    assert load_yaml(text) == expected


def test_aliases_and_merges_are_read() -> None:
    """Anchors, aliases and merge keys within the limits work, and scenes may use them."""
    text = "a: &a {x: 1}\nb: [*a, *a]\nc: {<<: *a, y: 2}"
    assert load_yaml(text) == {"a": {"x": 1}, "b": [{"x": 1}] * 2, "c": {"x": 1, "y": 2}}
    assert parse_document(text, heading="scene x").data == load_yaml(text)


def test_an_error_shows_the_place_and_not_the_whole_line() -> None:
    """The error about a line of 250 kB shows the characters around the place."""
    text = "a: [" + "1, " * 80_000 + "}"
    with pytest.raises(SceneError) as error:
        parse_document(text, heading="scene x")
    assert len(str(error.value)) < 500
    assert "}" in str(error.value)


def test_thousands_of_defects_are_counted_and_hundred_shown() -> None:
    """An error about thousands of defects has a bounded text; the whole list is in its attribute."""
    error = SceneError("scene x", ["y" * 10_000] * 5000)
    assert len(error.defects) == 5000
    assert len(str(error)) < 300_000
    assert "5000 defects" in str(error)
    assert "and 4900 more" in str(error)


@pytest.mark.parametrize(
    "text", ["[" * 200_000, '{"a":' * 200_000, "1" * 60_000, "{", "\ud800", "[" * 200_000 + "]" * 200_000]
)
@pytest.mark.parametrize("read", [load_json, load_json_object])
def test_json_that_cannot_be_read_is_an_error_of_one_kind(read: Callable, text: str) -> None:
    """Deep nesting, long numbers and broken JSON raise a ValueError."""
    with pytest.raises(ValueError):  # noqa: PT011 - the texts are those of the JSON reader
        read(text)


def test_json_of_another_kind_is_refused() -> None:
    """Where an object is expected, a list is refused."""
    with pytest.raises(ValueError, match="allowed: an object"):
        load_json_object("[1]")


@pytest.mark.parametrize(
    "text", ['<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "<a>" * 100, "x", "", "<a>" + "b" * 3_000_000 + "</a>"]
)
def test_xml_with_entities_or_defects_is_refused(text: str) -> None:
    """XML with a document type, which can expand without end, and broken or large XML raise a ValueError."""
    with pytest.raises(ValueError):  # noqa: PT011 - the texts are those of the XML reader
        parse_xml(text)


def test_a_check_takes_less_time_than_the_reading() -> None:
    """The check of a text within the limits is fast."""
    began = time.process_time()
    check_yaml("a: [" + "1.5, " * 90_000 + "]")
    assert time.process_time() - began < _PATIENCE
