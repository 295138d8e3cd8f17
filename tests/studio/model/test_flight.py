"""The frames of a flight are those of a run."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.studio.model.flight import PreviewFlight


@pytest.fixture(scope="module")
def flight() -> PreviewFlight:
    return PreviewFlight(rl.Scenario.load("examples/tdrs_approach.toml"))


def test_first_and_last_frame_are_among_the_chosen(flight: PreviewFlight) -> None:
    assert flight.numbers[0] == 0
    assert flight.numbers[-1] == flight.scenario.time.n_frames - 1
    assert len(flight.numbers) == 400 == len(set(flight.numbers))


@pytest.mark.parametrize("row", [0, 201, 399])
def test_a_frame_has_the_bits_of_a_run(flight: PreviewFlight, row: int) -> None:
    made = flight.frame(row, ("waveforms", "taps"))
    (flown,) = rl.simulate(flight.scenario, frames=[flight.numbers[row]])
    assert made.index == flown.index
    assert made.time_s == flown.time_s
    np.testing.assert_array_equal(made.range_m, flown.range_m)
    np.testing.assert_array_equal(made.intensity_counts, flown.intensity_counts)
    np.testing.assert_array_equal(made.labels.photons, flown.labels.photons)


def test_a_text_is_flown_once(flight: PreviewFlight) -> None:
    one = PreviewFlight.of("same", flight.scenario.replace(time=flight.scenario.time.replace(duration_s=20)))
    assert PreviewFlight.of("same", flight.scenario) is one
