"""Rosetta has the dimensions that were published of it, with Philae aboard."""

import numpy as np
import pytest

from models.build import rosetta_payload
from models.build.rosetta import BOOMS_M, BUS_M, rosetta


@pytest.fixture(scope="module")
def craft():
    return rosetta()


def test_span_wings_and_antenna_are_as_published(craft):
    # ESA fact sheet: 32 m from tip to tip, wings of 14 m; encyclopedia entry: antenna of 2.2 m
    assert craft.size_m[1] == pytest.approx(32.0, abs=0.05)
    for side in ("left", "right"):
        across = np.ptp(craft.parts[f"solar_substrate_{side}"].vertices, axis=0)
        assert across[:2] == pytest.approx([2.25, 14.0], abs=0.01)
    rim = np.ptp(craft.parts["antenna_high_gain"].vertices[:, :2], axis=0)
    assert rim == pytest.approx(2.2, abs=0.01)  # a rim of 56 sides is up to 3 mm short


def test_ten_panels_have_the_area_that_is_quoted(craft):
    # ESA: 64 m2 of solar array; ten panels of 2.25 m by 2.736 m are 61.6 m2, and the gaps lie between them
    boards = craft.parts["solar_substrate_left"].vertices[:, 1]
    gaps = (np.ptp(boards) - 5 * 2.736) / 4
    assert 0.03 < gaps < 0.12
    assert 10 * 2.25 * 2.736 == pytest.approx(64.0, rel=0.05)


def test_box_is_as_published(craft):
    # ESA fact sheet: 2.8 m x 2.1 m x 2.0 m; the deeper ends beside the lander and the drives stand out of it
    assert sorted(BUS_M) == [2.0, 2.1, 2.8]
    corners = craft.parts["bus"].vertices[:8]
    assert np.ptp(corners, axis=0) == pytest.approx(BUS_M)


def test_booms_end_in_their_probes_at_the_quoted_length(craft):
    probes = craft.parts["probes"].vertices
    for name, length_m in BOOMS_M.items():
        boom = craft.parts[f"boom_plasma_{name}"].vertices
        away = np.linalg.norm(probes[:, None] - boom[::7], axis=2)
        assert away.min() < 0.06, "a sphere of 5 cm at the tip"
        assert np.linalg.norm(np.ptp(boom, axis=0)) == pytest.approx(length_m, abs=0.15)  # with the hinge's box


def test_masses_are_those_of_the_orbiter_and_the_lander(craft):
    lander = sum(piece.mass_kg for name, piece in craft.pieces.items() if name.startswith("philae"))
    assert lander == pytest.approx(100.0)  # ESA, 'The Rosetta lander'
    assert craft.mass_kg - lander == pytest.approx(1230.0)  # encyclopedia entry: dry mass
    assert np.abs(craft.center_of_mass_m).max() < 0.15


def test_lander_is_a_metre_wide_and_its_cells_lie_on_its_hood(craft):
    hood, cells = rosetta_payload.lander().vertices, rosetta_payload.lander_cells().vertices
    assert np.ptp(hood[:12, 1]) == pytest.approx(1.0)
    assert np.all(cells.min(axis=0) >= hood.min(axis=0) - 0.01)
    inside = (np.abs(cells[:, 1]) < 0.49) & (cells[:, 0] > rosetta_payload.MIDDLE_M)
    assert not inside.any(), "no cell is buried in the hood"
