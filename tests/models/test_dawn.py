"""Dawn has the dimensions that were published of it, and the arrangement of NASA's model."""

import numpy as np
import pytest

from models.build.dawn import dawn


@pytest.fixture(scope="module")
def craft():
    return dawn()


def test_span_wings_and_antenna_are_as_published(craft):
    # Planetary Data System: 19.7 m from tip to tip, antenna of 1.52 m; NASA Space Science Data Coordinated Archive:
    # wings of 2.3 m by 8.3 m. Given to the last digit: half a digit
    assert craft.size_m[1] == pytest.approx(19.7, abs=0.05)
    for side in ("left", "right"):
        across = np.ptp(craft.parts[f"solar_substrate_{side}"].vertices, axis=0)
        assert across[1:] == pytest.approx([8.3, 2.3], abs=0.05)
    rim = np.ptp(craft.parts["antenna_high_gain"].vertices[:, 1:], axis=0)
    assert rim == pytest.approx(1.52, abs=0.01)  # the rim's wire stands out by 4 mm


def test_box_is_as_published_over_what_stands_on_it(craft):
    # Planetary Data System: 1.64 m x 1.27 m x 1.77 m
    def end(part, axis, far):
        ordinates = craft.parts[part].vertices[:, axis]
        return ordinates.max() if far else ordinates.min()

    antenna_mount = end("bus", 0, True)
    assert antenna_mount - end("spectrometer", 0, False) == pytest.approx(1.64, abs=0.005)
    assert end("radiator_left", 1, True) - end("radiator_right", 1, False) == pytest.approx(1.27, abs=0.005)
    assert end("instrument_bench", 2, True) - end("adapter_ring", 2, False) == pytest.approx(1.77, abs=0.005)


def test_wings_hold_five_panels_each(craft):
    cells = np.sort(np.unique(np.round(craft.parts["solar_array_left"].vertices[:, 1], 4)))
    gaps = np.diff(cells)
    assert np.count_nonzero(gaps > 0.05) == 5 * 8 + 4, "eight cells along each of five panels, gaps between"
    assert np.count_nonzero((gaps > 0.05) & (gaps < 0.15)) == 4, "a gap between each two panels"


def test_mass_is_the_published_dry_mass_and_lies_in_the_box(craft):
    assert craft.mass_kg == pytest.approx(747.1, rel=0.001)  # Planetary Data System
    assert np.abs(craft.center_of_mass_m).max() < 0.1


def test_three_ion_thrusters_point_away_from_the_deck(craft):
    exits = craft.parts["thruster_ion"].vertices
    thirds = [exits[exits[:, 0] < -0.5], exits[np.abs(exits[:, 0]) < 0.3], exits[exits[:, 0] > 0.5]]
    assert all(len(third) == len(thirds[0]) for third in thirds)
    assert sum(map(len, thirds)) == len(exits)
    assert all(third[:, 2].min() < -0.9 for third in thirds)
