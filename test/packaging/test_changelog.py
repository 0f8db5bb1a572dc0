# SPDX-License-Identifier: Apache-2.0
"""CHANGELOG.rst can be read by bloom and agrees with CHANGELOG.md."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from catkin_pkg.changelog import Changelog, populate_changelog_from_rst

UNRELEASED = "Forthcoming\n-----------\n"
"""Heading that catkin_prepare_release replaces by version and date."""


@pytest.fixture
def released(root: Path) -> Changelog:
    """Return the parsed CHANGELOG.rst, as bloom reads it after the release of package.xml's version."""
    version = ElementTree.parse(root / "package.xml").findtext("version")
    title = f"{version} (2026-12-31)"
    text = (root / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert text.count(UNRELEASED) <= 1
    changelog = Changelog("gdfe_ros")
    populate_changelog_from_rst(changelog, text.replace(UNRELEASED, f"{title}\n{'-' * len(title)}\n"))
    return changelog


def test_bloom_can_read_the_changelog(root: Path, released: Changelog) -> None:
    """After a release of package.xml's version, bloom finds it, and each version has entries."""
    versions = {version: entries for version, _, entries in released.foreach_version()}
    assert ElementTree.parse(root / "package.xml").findtext("version") in versions
    assert all(versions.values())


def test_both_changelogs_have_the_same_versions(root: Path, released: Changelog) -> None:
    """Both changelogs have the same versions with the same dates, or unreleased in both."""
    text = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    expected = dict(re.findall(r"^## (\S+) - (\S+)$", text, re.MULTILINE))
    found = {version: f"{date:%Y-%m-%d}" for version, date, _ in released.foreach_version()}
    open_ones = [version for version, date in expected.items() if date == "unreleased"]
    assert bool(open_ones) == (UNRELEASED in (root / "CHANGELOG.rst").read_text(encoding="utf-8"))
    assert found == {version: "2026-12-31" if version in open_ones else date for version, date in expected.items()}
