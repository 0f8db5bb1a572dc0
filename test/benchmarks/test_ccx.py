# SPDX-License-Identifier: Apache-2.0
"""CalculiX decks are written as in the kept runs, and CalculiX's output is read back."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cases import CASES, CHEETAH, CaseName, LogNeoHooke
from benchmarks.grids import Grid
from benchmarks.peers.ccx_deck import CcxElement, Incrementation, law_cards, used_nodes, write_deck
from benchmarks.peers.ccx_output import count_iterations, read_blocks, read_displacements, to_lattice

DATA = Path(__file__).resolve().parents[1] / "data" / "calculix"
PATIENT = Incrementation(first=0.25, patient=True)


def _deck(name: CaseName, cells: tuple[int, int, int], element: CcxElement, *, steps: int = 1) -> str:
    case = CASES[name]
    grid = case.grid(cells, order=element.order)
    return write_deck(case, grid, element, steps=steps, incrementation=Incrementation())


def test_the_deck_is_the_one_that_ran() -> None:
    """The written deck equals, line by line, the committed deck that CalculiX 2.20 solved."""
    case = CASES[CaseName.TENSILE]
    text = write_deck(case, case.grid((2, 1, 1)), CcxElement.C3D8, steps=2, incrementation=PATIENT)
    assert text == DATA.joinpath("bar.inp").read_text()


def test_the_terms_d2_and_d3_of_the_ogden_law_are_switched_off() -> None:
    """Ogden cards have D1 = 2/K, and D2 and D3 so large that their terms vanish; CalculiX would replace zeros."""
    values = ",".join(law_cards(CHEETAH, name="C")[2:]).split(",")
    assert len(values) == 9
    assert float(values[6]) == pytest.approx(2.0 / (CHEETAH.bulk * 1e-6), rel=1e-9)
    assert values[7:] == ["1e+15", "1e+15"]


def test_neo_hookean_materials_use_the_ciarlet_law() -> None:
    """A neo-Hookean material's name makes CalculiX use its Ciarlet law, in MPa."""
    cards = law_cards(LogNeoHooke(young=40e3, poisson=0.45), name="LAW3")
    assert cards == ["*MATERIAL, NAME=CIARLET_EL_LAW3", "*USER MATERIAL, CONSTANTS=2", "0.04,0.45"]


def test_a_sliding_handle_is_tied_and_not_prescribed_along_x() -> None:
    """For a sliding handle, all x displacements are tied to one of them, and only y and z are prescribed."""
    text = _deck(CaseName.BEND5, (5, 1, 1), CcxElement.C3D8I)
    assert text.count("*EQUATION\n2\n") == 3
    step = text[text.index("*STEP") :]
    assert not re.search(r"^\d+,1,1,", step, flags=re.MULTILINE)
    assert len(re.findall(r"^\d+,3,3,200$", step, flags=re.MULTILINE)) == 4


def test_quadratic_elements_have_twenty_nodes_and_no_face_centres() -> None:
    """A C3D20R element has twenty nodes, without face centres, and its long line is broken."""
    text = _deck(CaseName.TWIST90_UNIFORM, (1, 1, 1), CcxElement.C3D20R)
    nodes = text[text.index("*NODE") : text.index("*ELEMENT")].strip().splitlines()[1:]
    assert len(nodes) == 20
    rows = text[text.index("*ELEMENT") : text.index("*NSET")].strip().splitlines()[1:]
    numbers = [int(number) for number in "".join(rows).split(",")]
    assert rows[0].endswith(",")
    assert len(numbers) == 21
    assert set(numbers[1:]) == {int(line.split(",")[0]) for line in nodes}


def test_load_steps_follow_the_arc_of_a_turning_handle() -> None:
    """At the end of every load step the prescribed positions are on the circle of a turning handle."""
    text = _deck(CaseName.TWIST90, (2, 1, 1), CcxElement.C3D8, steps=2)
    first = text.split("*STEP")[1]
    corner = re.search(r"^3,2,2,(\S+)$", first, flags=re.MULTILINE)
    assert corner is not None
    assert float(corner.group(1)) == pytest.approx(25.0, abs=1e-8)  # (-25, -25) mm turned by 45 degrees: (0, -35.4)


def test_displacements_are_read_from_touching_columns() -> None:
    """Numbers of fixed width are read, also without a blank between them."""
    found = read_displacements(DATA.joinpath("bar.frd").read_text())
    assert len(found) == 12
    assert found[5] == (15.351, -2.27019, 2.27019)
    assert found[12] == (40.0, 0.0, 0.0)


def test_the_last_block_of_displacements_counts() -> None:
    """The displacements read are those at the end of the last step."""
    text = DATA.joinpath("bar.frd").read_text()
    block = text[text.index(" -4  DISP") : text.index(" 9999")]
    assert read_displacements(text.replace(block, block.replace("4.00000E+01", "2.00000E+01") + block))[12][0] == 40.0


def test_reactions_are_read_and_balance_sideways() -> None:
    """The handle's nodal forces are read; they sum to a force along x and to zero across."""
    forces = read_blocks(DATA.joinpath("bar.dat").read_text(), "forces")[1][-1]
    total = np.sum(list(forces.values()), axis=0)
    assert set(forces) == {3, 6, 9, 12}
    np.testing.assert_allclose(total, [4 * 2993.679, 0.0, 0.0], atol=1e-9)


def test_cut_off_output_is_refused() -> None:
    """Files that end before their results are refused."""
    text = DATA.joinpath("bar.frd").read_text()
    with pytest.raises(ValueError, match="cut off"):
        read_displacements(text[: text.rindex(" -3")])
    with pytest.raises(ValueError, match="no block DISP"):
        read_displacements("nothing")
    with pytest.raises(ValueError, match="no forces"):
        read_blocks("nothing", "forces")


def test_nodes_find_their_place_in_the_lattice() -> None:
    """Node n is at index n - 1, and numbers beyond the lattice are refused."""
    np.testing.assert_array_equal(to_lattice({2: (1.0, 2.0, 3.0)}, size=3), [[0, 0, 0], [1, 2, 3], [0, 0, 0]])
    with pytest.raises(ValueError, match="node 4"):
        to_lattice({4: (0.0, 0.0, 0.0)}, size=3)


def test_iterations_are_counted_from_the_log() -> None:
    """One linear solve is counted for each iteration in the log."""
    assert count_iterations(" increment 1 attempt 1 \n iteration 1\n\n average force= 1\n iteration 2\n") == 2


def test_used_nodes_skip_what_the_element_lacks() -> None:
    """Elements of 8 nodes use every lattice node, elements of 20 nodes no face or body centres."""
    assert len(used_nodes(Grid(size=(1, 1, 1), cells=(2, 1, 1)), CcxElement.C3D8)) == 12
    assert len(used_nodes(Grid(size=(1, 1, 1), cells=(2, 1, 1), order=2), CcxElement.C3D20R)) == 32
