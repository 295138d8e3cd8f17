"""Noise with an address: the same bits in any number of threads, and for a pixel that is drawn by itself."""

from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import Droop, Gsfl, detect
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import returns, simulate_rows

N = 3000  # pixels: several blocks
PHOTONS = replace(
    returns(900.0 + np.arange(N) % 200, np.geomspace(1.0, 1e5, N)), depth_spread_s=np.where(np.arange(N) % 3, 0.0, 2e-8)
)


@pytest.mark.parametrize("part", [Gsfl(), Gsfl(droop=Droop())], ids=["alone", "droop"])
def test_threads_do_not_change_a_bit(part):
    one, several = (detect(PHOTONS, part, np.random.default_rng(1), threads)[1] for threads in (1, 3))
    assert len(one.pixel) > 1000
    for name in ("pixel", "start_s", "latch_s", "samples_counts"):
        assert getattr(one, name).tobytes() == getattr(several, name).tobytes()


def test_a_pixel_is_drawn_again_by_itself():
    part = Gsfl()
    plan = plan_time(part, PHOTONS.pulse_fwhm_s)
    whole = simulate_rows(part, PHOTONS, place_rows(PHOTONS, plan), np.random.default_rng(2))
    for pixel in (0, 1500, N - 1):
        of = np.flatnonzero(PHOTONS.pixel == pixel)
        names = ("pixel", "delay_s", "photons", "depth_spread_s", "coherence_cells", "hit", "cluster")
        some = replace(PHOTONS, **{name: getattr(PHOTONS, name)[of] for name in names})
        alone = simulate_rows(part, some, place_rows(some, plan), np.random.default_rng(2))
        rows = whole.rows.pixel == pixel
        assert alone.rows.start.tolist() == whole.rows.start[rows].tolist()
        assert alone.amplitude.tobytes() == whole.amplitude[rows].tobytes()


def test_pixels_and_rows_differ():
    part, n = Gsfl(), 500
    photons = returns(np.full(n, 1000.0), 1e-3)
    plan = plan_time(part, photons.pulse_fwhm_s)
    made = simulate_rows(part, photons, place_rows(photons, plan), np.random.default_rng(3))
    noise = made.amplitude - made.amplitude.mean(axis=0)
    correlation = np.corrcoef(noise) - np.eye(n)
    independent = (
        made.amplitude.shape[1] * plan.step_s / (4.0 * part.amplifier.pole_s)
    )  # steps that know little of each other
    assert np.abs(correlation).mean() < 1.0 / np.sqrt(independent)
    again = simulate_rows(part, photons, place_rows(photons, plan), np.random.default_rng(4))
    assert abs(np.corrcoef(noise.ravel(), again.amplitude.ravel())[0, 1]) < 5.0 / np.sqrt(independent * n)
