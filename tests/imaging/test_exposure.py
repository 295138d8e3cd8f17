"""Exposures: what an image is made of, over time and row by row, and what it does not depend on."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError

BENCH = """
version = 1
name = "bench"
world = { axes = "local", sun_direction = [-1, 0, 0.2] }
time = { start_utc = 2024-09-17T12:00:00Z, duration_s = 2, frame_rate_hz = 1 }
follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
ptu = {}
lidar = { preset = "gsfl_1064", receiver = { n_rows = 16, n_cols = 16 } }
target = [{ name = "plate", model = "plate", motion = { type = "fixed", position_m = [100, 0, 0] } }]
"""
CAMERA = """
[[camera]]
name = "nav"
exposure_ms = 0.1
lens = { fov_deg = 8, f_number = 4, n_rows = 24, n_cols = 32 }
"""


def look(camera=CAMERA, *settings, bench=BENCH, frames=(0,), **chosen):
    scenario = rl.Scenario.loads(bench + camera, settings=settings)
    return list(rl.simulate(scenario, frames=frames, **chosen))


def image_of(frame, name="nav"):
    return frame.camera[name].intensity_counts.astype(float), frame.camera_labels[name]


@pytest.fixture(scope="module")
def sunlit():
    """The plate in the Sun, behind the lidar."""
    return look()[0]


def test_the_lidar_is_not_disturbed_by_a_camera(sunlit):
    alone = look(camera="")[0]
    np.testing.assert_array_equal(sunlit.range_m, alone.range_m)
    assert not alone.camera
    assert not alone.camera_labels


def test_labels_say_where_the_target_is_and_how_far(sunlit):
    counts, labels = image_of(sunlit)
    on_target = labels.target == 0
    assert counts.shape == (24, 32, 1)
    assert 100 <= on_target.sum() < 24 * 32
    assert np.all(np.abs(labels.range_m[on_target] - 100.0) < 0.1)
    assert np.all(np.isnan(labels.range_m[~on_target]))
    assert counts[on_target].min() > counts[labels.filled_fraction == 0.0].max() + 100


def test_an_image_does_not_depend_on_threads(sunlit):
    again = look(threads=1)[0]
    np.testing.assert_array_equal(again.camera["nav"].intensity_counts, sunlit.camera["nav"].intensity_counts)


def test_noise_differs_from_frame_to_frame_and_the_pattern_of_pixels_does_not():
    still = (
        CAMERA
        + "sensor = { read_noise_electrons = 0, response_nonuniformity_fraction = 0.3, full_well_electrons = 1e6 }"
    )
    frames = look(still, "time.frame_rate_hz=5", frames=(0, 1, 2))
    a, b, _ = (image_of(frame)[0] for frame in frames)
    assert (a != b).any()
    on_target = image_of(frames[0])[1].filled_fraction == 1.0
    assert np.corrcoef(a[on_target].ravel(), b[on_target].ravel())[0, 1] > 0.99


@pytest.mark.parametrize(("start_ms", "returns"), [(0.0, True), (0.01, False), (-0.05, True), (-0.2, False)])
def test_the_laser_is_seen_where_its_pulse_returns_within_the_exposure(start_ms, returns):
    dark = CAMERA + f'bands = [{{ name = "line", wavelength_nm = 1064, width_nm = 10 }}]\nstart_ms = {start_ms}'
    frame = look(dark, "world.sun_direction=[1, 0, 0]")[0]
    assert (frame.camera_labels["nav"].electrons.max() > 0.0) == returns


def test_a_laser_outside_the_band_is_not_seen():
    frame = look(CAMERA, "world.sun_direction=[1, 0, 0]")[0]
    assert frame.camera_labels["nav"].electrons.max() == 0.0


def test_auto_exposure_fills_the_wells_as_far_as_wanted():
    frame = look(CAMERA + "auto_exposure = { fill_fraction = 0.5, max_ms = 1000 }")[0]
    assert frame.camera_labels["nav"].electrons.max() == pytest.approx(5000, rel=0.02)
    dim = look(CAMERA + "auto_exposure = { max_ms = 0.01, min_ms = 0.001 }")[0]
    assert float(dim.camera["nav"].exposure_s) == pytest.approx(1e-5)


def test_a_rolling_shutter_sees_moving_targets_row_by_row():
    """A plate that crosses the field leans by its rate times the delay from row to row."""
    moving = BENCH.replace(
        'motion = { type = "fixed", position_m = [100, 0, 0] }',
        'motion = { type = "fixed", position_m = [100, 0, 0] }, attitude = { type = "spin", axis = [1, 0, 0], '
        "rate_deg_s = 90 }",
    )
    rolling = CAMERA + "row_delay_us = 10_000"
    still, leaning = (look(camera, bench=moving)[0].camera_labels["nav"].electrons for camera in (CAMERA, rolling))
    assert np.abs(still - leaning).max() > 0.5 * still.max()
    assert leaning.sum() == pytest.approx(still.sum(), rel=0.1)


def test_each_band_has_the_image_that_it_has_alone():
    gold = BENCH.replace('model = "plate",', 'model = "plate", material = "mli_gold",')
    electrons = look(CAMERA + 'bands = "rgb"', bench=gold)[0].camera_labels["nav"].electrons
    assert electrons.shape == (24, 32, 3)
    blue = 'bands = [{ name = "blue", wavelength_nm = 460, width_nm = 80, quantum_efficiency = 0.4 }]'
    alone = look(CAMERA + blue, bench=gold)[0].camera_labels["nav"].electrons
    np.testing.assert_allclose(electrons[..., 2], alone[..., 0], rtol=1e-6)
    red, _, dim = electrons.max(axis=(0, 1))
    assert red > 1.5 * dim  # gold foil


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('carrier = "arm"', "carrier"),
        ("start_ms = 1e9", "start_ms"),
        ('bands = "ultraviolet"', "known: grey, nir, rgb"),
        ("bands = []", "bands"),
        (
            "bands = [{ name = 'a', wavelength_nm = 500, width_nm = 9 }, { name = 'a', wavelength_nm = 600, width_nm = 9 }]",
            "two have",
        ),
        ("auto_exposure = { min_ms = 2, max_ms = 1 }", "min_ms"),
        ("sensor = { bits = 8, black_level_counts = 255 }", "black_level_counts"),
        ('sky = ["venus"]', "sky"),
    ],
)
def test_wrong_keys_are_named_with_their_cure(keys, words):
    with pytest.raises(ScenarioError, match=words):
        rl.Scenario.loads(BENCH + CAMERA + keys)


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        (CAMERA.replace("nav", "lidar"), "other axes already"),
        (CAMERA.replace("nav", "plate"), "other axes already"),
        (CAMERA + CAMERA, "other axes already"),
        (CAMERA.replace("f_number = 4", "f_number = 4, filter_width_nm = 3"), "bands"),
    ],
)
def test_names_and_filters_that_clash_are_refused(camera, words):
    with pytest.raises(ScenarioError, match=words):
        rl.Scenario.loads(BENCH + camera)


def test_a_camera_on_a_ptu_needs_one():
    with pytest.raises(ScenarioError, match="add \\[ptu\\]"):
        rl.Scenario.loads(BENCH.replace("ptu = {}", "") + CAMERA + 'carrier = "ptu"')


def test_a_recording_holds_images_and_labels(tmp_path, sunlit):
    rl.save(tmp_path / "run.h5", [sunlit])
    with rl.open(tmp_path / "run.h5") as recording:
        frame = recording[0]
        np.testing.assert_array_equal(frame.camera["nav"].intensity_counts, sunlit.camera["nav"].intensity_counts)
        np.testing.assert_array_equal(frame.camera_labels["nav"].part, sunlit.camera_labels["nav"].part)
        np.testing.assert_array_equal(recording.camera["nav"].range_m[0], sunlit.camera_labels["nav"].range_m)
        assert rl.Scenario.loads(recording.source.scenario).camera[0].name == "nav"
        np.testing.assert_allclose(frame.truth.pose("nav", "plate").translation, [0, 0, 100], atol=1e-12)
