"""Noise draws of one pose: each is the frame of its own seed, and rays are cast once where the light has no noise.

Cameras beside the lidar see the same target in the same light.
"""

import numpy as np
import pytest

from rso_lidar import sampling
from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.making.flight import fly_sample, label, list_kept
from rso_lidar.dataset.shards.layout import list_entries
from rso_lidar.detector.bench import scatter_table
from rso_lidar.simulation import simulate
from tests.dataset.bench_for_tests import CAMERA, SUN, find_sample, make_spec

GSFL = 'lidar.detector={type="gsfl"}'
SUNLIT = (GSFL, SUN, "lidar.receiver.filter_width_nm=10.0")
ALL_LABELS = {"part_visibility": True, "oversampled": True, "camera_electrons": True}


@pytest.mark.parametrize(
    ("settings", "casts"),
    [
        ((), 1),
        (SUNLIT, 1),
        (('lidar.detector={type="geiger"}',), 1),
        (("lidar.laser.energy_jitter_fraction=0.05",), 3),
        (("lidar.bounces=2",), 3),
        ((CAMERA, SUN), 2),
        ((CAMERA, SUN, "lidar.laser.energy_jitter_fraction=0.05"), 6),
    ],
)
def test_each_draw_is_the_frame_of_its_seed(tmp_path, monkeypatch, settings, casts):
    spec = make_spec(tmp_path, draws=3, set=settings, labels=ALL_LABELS, sequence={"frames": 2})
    plan = make_plan(spec)
    sample = draw_sample(plan, find_sample(plan, 0, 0))
    cast, calls = sampling.cast_pixels, []

    def count(*given, **chosen):
        calls.append(1)
        return cast(*given, **chosen)

    monkeypatch.setattr(sampling, "cast_pixels", count)
    flown = [frame for frame, _ in fly_sample(plan, sample)]
    monkeypatch.undo()
    assert len(calls) == 2 * casts and len(flown) == 6
    keep = (*list_kept(spec.labels), "prediction")
    for draw, seed in enumerate(sample.seeds):
        alone = simulate(sample.scenario.replace(seed=seed), frames=sample.frames, threads=1, keep=keep)
        for step, frame in enumerate(alone):
            expected, found = label(plan, sample, frame, step, draw), flown[3 * step + draw]
            ours, theirs = list_entries(found), list_entries(expected)
            assert ours.keys() == theirs.keys()
            for name, entry in ours.items():
                assert entry.tobytes() == theirs[name].tobytes(), name
    assert not np.array_equal(flown[0].range_m, flown[1].range_m, equal_nan=True)
    for image, other in zip(flown[0].camera.values(), flown[1].camera.values(), strict=True):
        assert not np.array_equal(image.intensity_counts, other.intensity_counts)
        assert image.exposure_s == other.exposure_s and np.array_equal(image.electrons, other.electrons)


def test_cameras_leave_the_lidars_bits(tmp_path):
    alone, both = (make_plan(make_spec(tmp_path, draws=2, set=settings)) for settings in ((SUN,), (SUN, CAMERA)))
    for k in range(3):
        index = find_sample(alone, k, 1)
        pairs = zip(
            fly_sample(alone, draw_sample(alone, index)), fly_sample(both, draw_sample(both, index)), strict=True
        )
        for (ours, _), (theirs, _) in pairs:
            entries, others = list_entries(ours), list_entries(theirs)
            assert set(others) - set(entries) == {name for name in others if name.startswith("camera.nav.")}
            for name, entry in entries.items():
                assert entry.tobytes() == others[name].tobytes(), name


def test_a_camera_sees_the_drawn_target_in_the_drawn_sunlight(tmp_path):
    """The silhouette of a sphere is about the projection of its centre, and its lit side is towards the Sun."""
    near = {"type": "uniform", "low": [-0.2, -0.2], "high": [0.2, 0.2]}
    view = {
        "range_m": {"type": "uniform", "low": 100, "high": 150},
        "offset_fraction": near,
        "sun": {"type": "direction"},
    }
    spec = make_spec(tmp_path, set=(CAMERA, "camera[0].sky=[]"), view=view, draws=1, labels={"camera_electrons": True})
    plan = make_plan(spec.replace(classes=[{"name": "ball", "models": ["sphere"], "samples": 9}, spec.classes[2]]))
    towards = []
    for number in range(8):
        ((frame, _),) = fly_sample(plan, draw_sample(plan, find_sample(plan, 0, number)))
        image = frame.camera["nav"]
        x, y, z = image.position_m
        assert image.position_m - frame.position_m == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)  # the mount, to the left
        assert image.quaternion_xyzw == pytest.approx(frame.quaternion_xyzw)
        focal_px, _, *centre = image.intrinsics_px
        row, col = np.nonzero(image.target == 0)
        place = focal_px * np.array([x / z, y / z]) + centre
        share = image.filled_fraction[row, col].astype(float)
        # 16 rays in a pixel: less than a quarter of a pixel in the mean place of the silhouette
        assert np.array([col @ share, row @ share]) / share.sum() == pytest.approx(place, abs=0.25)
        radius_px = focal_px * 0.5 * plan_diameter_m(plan) / z
        # of an edge of 2 pi r pixels, the share of each is known to about 1/sqrt(16): 4 sigma of their sum
        within = 4.0 * 0.25 * np.sqrt(2.0 * np.pi * radius_px)
        assert share.sum() == pytest.approx(np.pi * radius_px**2, abs=within) and image.target_pixels == len(row)
        assert image.box_px.tolist() == [row.min(), col.min(), row.max(), col.max()]
        light = image.electrons[..., 0]
        lit = light > 0.05 * light.max()
        if not lit.any():
            continue
        sun = frame.sun_direction
        rows, cols = np.indices(light.shape)
        mean = np.array([(cols * light).sum(), (rows * light).sum()]) / light.sum() - place
        if np.linalg.norm(sun[:2]) > 0.5:
            towards.append(mean @ sun[:2] / np.linalg.norm(mean) / np.linalg.norm(sun[:2]))
    assert len(towards) >= 4 and min(towards) > 0.9
    ((frame, _),) = fly_sample(plan, draw_sample(plan, find_sample(plan, 1, 0)))
    image = frame.camera["nav"]
    assert (image.target == -1).all() and not image.electrons.any() and image.target_pixels == 0
    assert (image.box_px == -1).all() and np.isnan(image.position_m).all() and np.isnan(image.range_m).all()


def plan_diameter_m(plan):
    """Return the diameter of the sphere in a plan [m]."""
    return np.ptp(draw_sample(plan, find_sample(plan, 0, 0)).scenario.surfaces[0].corners.reshape(-1, 3), axis=0).max()


@pytest.mark.parametrize(
    ("field", "law", "is_drawn"),
    [
        ("lidar.laser.pulse_fwhm_ns", {"type": "uniform", "low": 6, "high": 10}, True),
        ("lidar.laser.pulse_fwhm_ns", {"type": "choice", "values": [6, 10]}, False),
        ("lidar.laser.energy_mj", {"type": "uniform", "low": 6, "high": 10}, False),
        ("lidar.detector.camera_seed", {"type": "whole", "low": 0, "high": 1000}, False),
        ("lidar.detector.apd.gain", {"type": "normal", "mean": 10, "sigma": 1, "low": 8, "high": 12}, True),
    ],
)
def test_no_table_is_filled_for_a_detector_of_one_sample(tmp_path, field, law, is_drawn):
    variable = [{"field": field, "law": law}]
    spec = make_spec(tmp_path, variable=variable, draws=1, labels={"prediction": True}, set=(GSFL,))
    assert spec.draws_detector is is_drawn
    if not is_drawn:
        return
    plan = make_plan(spec)
    filled = scatter_table._try_levels.cache_info().misses
    ((frame, _),) = fly_sample(plan, draw_sample(plan, find_sample(plan, 0, 0)))
    assert scatter_table._try_levels.cache_info().misses == filled
    lit = frame.detection_probability > 0.9
    assert lit.any() and (0.003 < frame.range_sigma_m[lit]).all() and (frame.range_sigma_m[lit] < 0.3).all()
