"""Bloom: who collects the charge that full pixels spill, how much, and that no generator and no thread decides it."""

import dataclasses

import numpy as np
import pytest

from rso_lidar.detector import Bloom, Gsfl, detect, make_point_returns
from rso_lidar.detector.chain.charge_spill import find_spill, spill_charge
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Laser

LASER = Laser()
SHAPE = (9, 11)
PER_PHOTON = Gsfl().electrons_per_photon
WELL = Bloom().full_well_electrons / PER_PHOTON  # photons that fill a pixel


def light(pixels, photons, range_m=900.0):
    order = np.argsort(pixels, kind="stable")
    given = (np.broadcast_to(np.asarray(value, dtype=float), len(pixels))[order] for value in (range_m, photons))
    return make_point_returns(SHAPE, LASER.pulse, LASER.pulse_fwhm_s, np.asarray(pixels)[order], *given)


def image_of(photons):
    return np.bincount(photons.pixel, photons.photons, np.prod(SHAPE)).reshape(SHAPE)


def test_four_neighbours_collect_a_quarter_each():
    after = image_of(spill_charge(Bloom(spill_fraction=0.4), light([4 * 11 + 5], 2 * WELL), PER_PHOTON))
    by_hand = np.zeros(SHAPE)
    by_hand[4, 5] = 2 * WELL - 0.4 * WELL
    for row, col in ((3, 5), (5, 5), (4, 4), (4, 6)):
        by_hand[row, col] = 0.1 * WELL
    assert after == pytest.approx(by_hand, rel=1e-9)


def test_neighbours_that_overflow_spill_on():
    """f of what is above the well goes on, wherever it was made: the two full pixels of a row pass charge to and fro."""
    held = np.full((1, 3), 0.0)
    held[0, 1], held[0, 0] = 5.0, 1.0  # the well is 1: what pixel 0 collects is all above it
    lost, collected = find_spill(held, 1.0, 0.4)
    f = 0.4
    sent = f * 4.0  # of pixel 1 at first; pixel 0 sends a quarter of f of its part back, and so on
    one = sent / (1 - (f / 4) ** 2)
    assert lost[0, 1] == pytest.approx(one, rel=1e-5)
    assert collected[0, 0] == pytest.approx(one / 4, rel=1e-5)
    assert lost[0, 0] == pytest.approx(f * one / 4, rel=1e-5)


@pytest.mark.parametrize("times", [1.5, 40.0, 3000.0])
def test_charge_is_conserved_in_the_middle_and_lost_over_the_edge(times):
    inner = light([4 * 11 + 5, 4 * 11 + 6], times * WELL)
    bloom = Bloom(spill_fraction=0.5)
    after = image_of(spill_charge(bloom, inner, PER_PHOTON))
    if times < 50.0:  # it does not reach the edge
        assert after.sum() == pytest.approx(image_of(inner).sum(), rel=1e-5)
    assert after.sum() <= image_of(inner).sum() * (1 + 1e-9)
    corner = light([0], 2 * WELL)
    after = image_of(spill_charge(bloom, corner, PER_PHOTON))
    assert after.sum() == pytest.approx(2 * WELL - 0.25 * WELL, rel=1e-9)  # two of its four neighbours exist


def test_below_the_well_nothing_changes():
    given = light([30, 31, 40], 0.999 * WELL)
    assert spill_charge(Bloom(), given, PER_PHOTON) is given
    assert spill_charge(Bloom(spill_fraction=0.0), light([30], 5 * WELL), PER_PHOTON).photons.tolist() == [5 * WELL]


def test_collected_charge_comes_with_its_pulse():
    """Two pulses far apart fill the wells apart; charge has the delay of the pulse that spills, or is later."""
    pixel = 4 * 11 + 5
    given = light([pixel, pixel], [0.8 * WELL, 2 * WELL], [300.0, 900.0])
    late = spill_charge(Bloom(delay_ns=2.0), given, PER_PHOTON)
    beside = late.pixel == pixel + 1
    assert late.delay_s[beside] == pytest.approx(given.delay_s[1] + 2e-9, rel=1e-12)
    assert late.photons[late.pixel == pixel] == pytest.approx([0.8 * WELL, 1.8 * WELL], rel=1e-9)
    assert np.all(np.diff(late.pixel) >= 0)
    assert np.all(late.cluster_pixel[late.cluster] == late.pixel) and np.all(np.diff(late.cluster_pixel) >= 0)
    assert set(late.hit.tolist()) <= {0, 1}


@pytest.mark.parametrize(("photons", "brightest"), [([2.0, 0.3], 0), ([0.3, 2.0], 1)])
def test_collected_charge_belongs_to_the_brightest_return_of_the_pixel_that_spills(photons, brightest):
    pixel = 4 * 11 + 5
    given = light([pixel, pixel], np.array(photons) * WELL)
    after = spill_charge(Bloom(), given, PER_PHOTON)
    assert after.hit[after.pixel == pixel + 1].tolist() == [given.hit[brightest]]


def test_each_pulse_of_a_frame_fills_the_wells_alone():
    """A frame of four pulses, one of which sees a glint: its charge in that pulse is four times its mean."""
    pixel = 4 * 11 + 5
    given = light([pixel, pixel], [0.5 * WELL, 0.1 * WELL], [900.0, 900.0])
    moving = dataclasses.replace(given, epoch=np.array([0, 1]), pulse_epoch=np.array([0, 1, 1, 1]))
    after = spill_charge(Bloom(spill_fraction=0.4), moving, PER_PHOTON)
    beside = after.pixel == pixel + 1
    assert after.photons[beside] == pytest.approx(
        [0.25 * 0.1 * WELL]
    )  # 0.4 (2 - 1) / 4 of the well in one pulse of four
    assert after.epoch[beside].tolist() == [0]


def test_threads_do_not_matter_and_neighbours_report():
    gsfl = Gsfl(bloom=Bloom(spill_fraction=0.3))
    given = light([4 * 11 + 5], 30 * WELL)
    made = [detect(given, gsfl, np.random.Generator(np.random.Philox(5)), threads)[0] for threads in (1, 2, 4)]
    for one in made[1:]:
        assert np.array_equal(one.range_m, made[0].range_m, equal_nan=True)
        assert np.array_equal(one.intensity_counts, made[0].intensity_counts)
    plain = detect(given, Gsfl(), np.random.Generator(np.random.Philox(5)))[0]
    around = np.isfinite(made[0].range_m)
    assert np.isfinite(plain.range_m).sum() == 1 and around[4, 5] and around.sum() >= 5
    assert made[0].range_m[around] == pytest.approx(900.0, abs=3.0)


@pytest.mark.parametrize(
    "table", [{"spill_fraction": 1.0}, {"full_well_electrons": 0.0}, {"delay_ns": -1.0}, {"well": 1.0}]
)
def test_bad_blooms_are_refused(table):
    with pytest.raises(ScenarioError) as caught:
        Gsfl().replace(bloom=table)
    assert "bloom" in str(caught.value) and "\n" not in str(caught.value)
