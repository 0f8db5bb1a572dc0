# SPDX-License-Identifier: Apache-2.0
"""A sample of the torture test that runs with every test run."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.torture import walks
from benchmarks.torture.bodies import BAR, LAWS, make_scene
from benchmarks.torture.case import Case, Finding, Group, Outcome, Verdict, attempt
from benchmarks.torture.catalogue import all_cases
from benchmarks.torture.score import score_of, torture_table
from gdfe_ros.errors import CommandError
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy

CASES = all_cases(walk_steps=100)
WATCHED = ("tendon_finger, tolerance 1e-05",)
"""Cases that have failed before: the stored tangent was a hundred times too stiff, and was used after an update."""
LONG = (
    "plate 1:100, fine",
    "100 pokes",
    "10 knocks",
    "a mesh through it",
    "a thin wall through it",
    "a dome through",
    "an arch through",
    "bending_tube",
    "three_chamber_arm",
    "capsules",
    "boxes, coarse",
    "edges across edges",  # a minute of processor time; the samples `edge on edge` and test_crossing.py have edges, too
    "fork",  # test_certified.py draws them
)
"""Beginnings of the names of cases that take many seconds; `make torture` runs them."""
SAMPLE = [case for case in CASES if case.group is not Group.WALKS and case.law != "its own"][::6]
SAMPLE = [case for case in SAMPLE if not case.name.startswith(LONG)]
SAMPLE += [case for case in CASES if case.name in WATCHED and case not in SAMPLE]
STEPS = 250


def test_names_of_cases_are_unique() -> None:
    """Each case has a name of its own, by which another process finds it."""
    assert len({case.id for case in CASES}) == len(CASES)


@pytest.mark.parametrize("case", SAMPLE, ids=[case.id for case in SAMPLE])
def test_sample(case: Case) -> None:
    """Every sixth case passes, or is refused with the expected words."""
    outcome = attempt(case)
    assert outcome.verdict is not Verdict.FAILED, outcome.text


@pytest.mark.parametrize("name", walks.TRACKS)
def test_short_walk(name: str) -> None:
    """In 250 steps and the steps back, all steps converge, the drift is below 1e-6, and memory does not grow."""
    found = walks.walk(walks.TRACKS[name], STEPS)
    assert found.unconverged == 0
    assert found.drift <= walks.BOUND
    assert found.growth <= walks.MOST_GROWTH


def test_catalogue_is_large_and_covers_every_group() -> None:
    """The catalogue has at least 150 cases, with both policies and every group."""
    assert len(CASES) >= 150
    assert {case.group for case in CASES} == set(Group)
    assert {case.policy for case in CASES} == set(Policy)


def _case(**options: object) -> Case:
    values = {"group": Group.LAWS, "name": "n", "policy": Policy.ENERGY, "law": "l", "bound": 1.0, **options}
    return Case(**values)


def _refuse() -> Finding:
    raise CommandError("handle 'x' is fixed")


def test_a_refusal_counts_only_where_it_is_due() -> None:
    """A refusal counts only with the expected words, and is a failure where a solution was expected."""
    verdicts = [attempt(_case(run=_refuse, refusal=words)).verdict for words in ("is fixed", "is free", "")]
    assert verdicts == [Verdict.REFUSED, Verdict.FAILED, Verdict.FAILED]


def test_other_errors_are_not_swallowed() -> None:
    """An exception that is no refusal is raised."""

    def broken() -> Finding:
        raise KeyError("bug")

    with pytest.raises(KeyError):
        attempt(_case(run=broken))


def test_the_table_counts() -> None:
    """The table counts verdicts of scores read from a file, and has the worst error and the longest case."""
    outcomes = [
        Outcome(Verdict.CONVERGED, 1e-3, 1e-2, 1, 0, 1.0),
        Outcome(Verdict.REPORTED, 1e-3, 1.0, 1, 2, 3.0),
        Outcome(Verdict.REFUSED, np.nan, np.inf, 3, 1, 0.5, "no"),
    ]
    scores = json.loads(json.dumps([score_of(_case(run=_refuse), outcome) for outcome in outcomes], allow_nan=False))
    lines = torture_table(scores)["torture"].splitlines()
    assert lines[2:] == [f"| {name} | 3 | 1 | 1 | 1 | 0 | 1.0e-03 / 1e-02 | 3 | 3.0 |" for name in ("6 laws", "all")]


def test_a_report_needs_a_sound_state() -> None:
    """A report with inverted elements, or without a message, is a failure."""
    simulation = Simulation(make_scene(BAR, LAWS["linear"], policy=Policy.ENERGY))
    sound = replace(simulation.step(), converged=False, message="it buckled")
    folded = replace(sound, min_det=-0.1)
    verdicts = [
        attempt(_case(run=lambda r=r: Finding((r,), 0.0), may_report=True)).verdict
        for r in (sound, folded, replace(sound, message=""))
    ]
    assert verdicts == [Verdict.REPORTED, Verdict.FAILED, Verdict.FAILED]


def test_walk_flaws_are_named() -> None:
    """Memory growth, slower steps, more iterations and unconverged steps of a walk are named."""
    simulation = Simulation(make_scene(BAR, LAWS["linear"], policy=Policy.ENERGY))
    good = walks.Walk(simulation.step(), 0, 0.0, 1e6, (1.0, 1.05), (100, 105))
    assert good.flaws() == []
    bad = replace(good, unconverged=3, growth=6e6, times=(1.0, 1.2), iterations=(100, 120))
    assert [flaw.split()[0] for flaw in bad.flaws()] == ["3", "memory", "a", "a"]
