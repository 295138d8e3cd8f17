"""Blurred light against its oracle in NumPy."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.optics import AiryPsf, BrownConrady, FieldDependentPsf, FieldPsf, GaussianPsf, Receiver, collect
from rso_lidar.optics.returns import spread
from rso_lidar.optics.sorting import sort_by
from rso_lidar.scene import Lambertian, RetroReflector
from tests.optics.bench_for_tests import PAPER_LASER, box, place, plate, see, sphere, surface, truth_of
from tests.reference.optics import radiometry as oracle

LENS = Receiver(focal_length_mm=300, f_number=2.8, n_rows=40, n_cols=48)
FIELD = FieldDependentPsf(
    fields=(FieldPsf(field_deg=0.1, psf=AiryPsf()), FieldPsf(field_deg=0.6, psf=GaussianPsf(sigma_um=50.0)))
)
KERNELS = {
    "sharp": GaussianPsf(sigma_um=1.0),
    "gaussian": GaussianPsf(sigma_um=25.0),
    "wide": GaussianPsf(sigma_um=120.0),
    "airy": AiryPsf(),
    "halo": GaussianPsf(sigma_um=10.0, halo_fraction=0.05, halo_radius_um=40.0),
    "field": FIELD,
}


@cache
def hits_of(lens, range_m=1000.0):
    """Return hits on a box before a sphere before a tall black plate that leaves the field, and on a small cube far off."""
    targets = [
        surface("box", box(3.1, 2.2, 1.7)),
        surface("sphere", sphere(4.0, 3)),
        surface("black", plate(1.5, 60.0), Lambertian(reflectance=0.0)),
        surface("cube", plate(0.02), RetroReflector(diameter_mm=12.7, reflectance=0.7, fill_fraction=1.0).at(1064e-9)),
    ]
    lean = Rotation.from_rotvec(
        [0.11, 0.07, 0.23]
    )  # without symmetry: which of two equal depths comes first is rounding
    truth = truth_of(
        box=place((-1.3, 0.4, range_m), lean),
        sphere=place((1.27, -2.11, range_m + 31.0), lean),
        black=place((0.3, 0.2, range_m + 50.0), lean),
        cube=place((5.33, 4.21, range_m + 7.0), lean),
    )
    return see(targets, truth, lens.replace(psf=None)).hits


def agree(hits, lens):
    """Same returns in the same order: whole numbers exactly, the rest to rounding; return how many there are.

    Far light comes by a Fourier transform, whose rounding is 1e-16 of the brightest pixel; the depth spread is a difference
    of squares of delays that are known to their last digit, 4e-22 s.
    """
    reference = oracle.collect(hits, PAPER_LASER, lens)
    ours = collect(hits, PAPER_LASER, lens)
    for name in ("pixel", "hit", "cluster", "cluster_pixel"):
        assert np.array_equal(getattr(ours, name), getattr(reference, name)), name
    np.testing.assert_allclose(ours.delay_s, reference.delay_s, rtol=5e-14, atol=0.0)  # a mean of delays
    # Far light of a single group has the delay of its near light, but for rounding: in which order they come is chance.
    apart = (np.diff(ours.delay_s, prepend=-1.0) > 1e-18) | (np.diff(ours.pixel, prepend=-1) > 0)
    tied = np.flatnonzero(apart) if len(apart) else np.zeros(0, np.int64)

    def summed(light, name):
        return np.add.reduceat(getattr(light, name), tied) if len(tied) else np.zeros(0)

    brightest = reference.photons.max(initial=0.0)
    limits = {"photons": (1e-12, 1e-15 * brightest), "depth_spread_s": (1e-9, 1e-20), "coherence_cells": (1e-12, 1e-14)}
    for name, (rtol, atol) in limits.items():
        np.testing.assert_allclose(summed(ours, name), summed(reference, name), rtol=rtol, atol=atol, err_msg=name)
    return len(ours.pixel)


@pytest.mark.parametrize(
    ("kernel", "distortion"),
    [*((kernel, None) for kernel in KERNELS), ("gaussian", BrownConrady(k1=20.0)), ("field", BrownConrady(k1=20.0))],
    ids=[*KERNELS, "gaussian, bent", "field, bent"],
)
def test_the_same_light_in_the_same_order(kernel, distortion):
    lens = LENS.replace(distortion=distortion)
    hits = hits_of(lens)
    assert agree(hits, lens.replace(psf=KERNELS[kernel])) > len(np.unique(hits.pixel))


@pytest.mark.parametrize("rays_per_pixel", [1, 9, 64])
def test_any_number_of_rays(rays_per_pixel):
    lens = LENS.replace(rays_per_pixel=rays_per_pixel)
    agree(hits_of(lens), lens.replace(psf=KERNELS["gaussian"]))


@pytest.mark.parametrize("focal_length_mm", [3.0, 10.0])
def test_a_whole_scene_in_one_pixel(focal_length_mm):
    """Thousands of returns of a pixel, in many bins of delay."""
    lens = LENS.replace(psf=KERNELS["gaussian"], focal_length_mm=focal_length_mm, n_rows=9, n_cols=9)
    hits = hits_of(lens.replace(rays_per_pixel=180**2, min_rays_per_target=0))
    assert np.bincount(hits.pixel).max() > 1000
    agree(hits, lens)


def test_no_hit_and_one_hit():
    lens = LENS.replace(psf=KERNELS["gaussian"], min_rays_per_target=0, rays_per_pixel=1)
    assert agree(see([], truth_of(), lens).hits, lens) == 0
    one = see(surface("plate", plate(0.2)), truth_of(plate=place((1 / 6, 1 / 6, 1000.0))), lens).hits
    assert len(one.ray) == 1 and agree(one, lens) >= 1


@pytest.mark.parametrize(("n", "kinds"), [(0, 1), (1, 1), (16, 3), (17, 3), (33, 2), (1000, 7), (1000, 10**6)])
def test_sorting_keeps_equal_ones_in_order(n, kinds):
    value = np.random.default_rng(n).integers(0, kinds, n + 5).astype(float)
    ours, order = value.copy(), np.arange(n + 5)
    sort_by(ours, order, (np.empty(n + 5, np.int64), np.empty(n + 5)), 3, n + 3)
    expected = np.concatenate([[0, 1, 2], 3 + np.argsort(value[3 : n + 3], kind="stable"), [n + 3, n + 4]])
    assert np.array_equal(order, expected) and np.array_equal(ours, value[expected])


def test_each_kernel_is_compiled_for_one_combination_of_types():
    for changes in ({}, {"psf": FIELD}, {"distortion": BrownConrady(k1=20.0)}, {"filter_width_nm": 1.0}):
        lens = LENS.replace(**{"psf": KERNELS["gaussian"], **changes})
        agree(hits_of(LENS), lens)
    kernels = spread.locate_rays, spread.group_by_delay, spread.spread_groups, spread.gather_returns
    assert [len(kernel.dispatcher.signatures) for kernel in kernels] == [1] * 4
