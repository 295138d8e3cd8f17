"""Augmentation against the statistics in the labels, and against projection by the rotated pose."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.dataset.torch import LowerEnergy, MirrorImages, QuarterTurns, RedrawNoise
from rso_lidar.dataset.training.augmentation import mirror_frame, turn_frame
from tests.dataset.training.frame_for_tests import COUNTS_PER_PHOTON, F_PX, N, make_frame

DRAWS = 400


def redraw(augmentation, frame, draws=DRAWS):
    return [augmentation(dict(frame), np.random.default_rng(k)) for k in range(draws)]


class TestRedrawNoise:
    def test_pixels_report_by_their_labels(self):
        frame = make_frame()
        kept = {name: values.copy() for name, values in frame.items()}
        drawn = redraw(RedrawNoise(), frame)
        range_m = np.array([one["range_m"] for one in drawn], float)
        lit = np.isfinite(frame["true_range_m"])
        lit[14, 18] = False  # reports noise
        wanted = frame["detection_probability"][lit].astype(float)
        share = np.isfinite(range_m[:, lit]).mean(axis=0)
        spread = np.maximum(wanted * (1.0 - wanted), 1e-3) / DRAWS
        assert np.mean((share - wanted) ** 2 / spread) < 1.4  # mean of chi-squares, some 250 pixels
        error = (range_m - frame["true_range_m"])[:, lit] / frame["range_sigma_m"][lit]
        error = error[np.isfinite(error)]
        assert error.mean() == pytest.approx(0.0, abs=4.0 / np.sqrt(len(error)))
        assert error.std() == pytest.approx(1.0, abs=0.01 + 4.0 / np.sqrt(2.0 * len(error)))
        for name, values in frame.items():  # the frame itself is not changed
            np.testing.assert_array_equal(values, kept[name])

    def test_false_alarms_stay_unless_the_pixel_now_reports(self):
        drawn = redraw(RedrawNoise(), make_frame(), 50)
        assert {(float(one["range_m"][2, 3]), int(one["intensity_counts"][2, 3])) for one in drawn} == {(321.0, 17)}
        inside = np.array([one["range_m"][14, 18] for one in drawn])
        assert set(inside[inside < 400.0]) <= {222.0} and (inside > 400.0).any()

    def test_counts_follow_the_light_with_the_stated_noise(self):
        frame = make_frame(light=4000.0, noisy=False)
        drawn = redraw(RedrawNoise(excess=4.0, noise_photons=100.0), frame, 200)
        bright = (frame["photons"] > 3000.0) & (frame["photons"] < 5000.0) & (frame["detection_probability"] > 0.999)
        bright[14, 18] = False
        counts = np.array([one["intensity_counts"] for one in drawn], float)[:, bright] / COUNTS_PER_PHOTON
        light = frame["photons"][bright].astype(float)
        assert counts.mean() == pytest.approx(light.mean(), rel=0.02)
        wanted = np.sqrt(100.0**2 + 4.0 * light)
        # Bins of 16 pixels hold some spread of light, which bends the curve a little.
        assert np.mean(counts.std(axis=0) / wanted) == pytest.approx(1.0, abs=0.15)

    def test_as_much_light_as_that_of_the_faintest_saturated_pixel_saturates(self):
        frame = make_frame(light=4000.0, noisy=False)
        lit = frame["photons"] > 0.0
        frame["detection_probability"][lit] = 1.0
        full = (frame["photons"] > 5000.0) & np.isfinite(frame["range_m"])
        full[14, 18] = False  # reports noise
        frame["saturated"][full] = 1
        (one,) = redraw(RedrawNoise(), frame, 1)
        expected = lit & (frame["photons"] >= frame["photons"][full].min())
        np.testing.assert_array_equal(one["saturated"].astype(bool), expected)

    def test_a_frame_without_light_or_reports(self):
        dark = make_frame(light=1.0)
        dark["range_m"][:] = np.nan
        dark["detection_probability"][5, 5] = 1.0  # of no light: nothing is drawn there
        (one,) = redraw(RedrawNoise(), dark, 1)
        assert np.isnan(one["range_m"][5, 5])
        assert (one["intensity_counts"][np.isfinite(one["range_m"])] == 1).all()


class TestLowerEnergy:
    class Split:
        """A split of 40 frames of a sensor and one of another."""

        def column(self, name):
            assert name == "sensor_id"
            return np.array([0] * 40 + [1])

        def read(self, rows, names):
            frames = [make_frame(100 + int(k), light=300.0 * 1.1**k) for k in rows]
            return {name: np.stack([frame[name] for frame in frames]) for name in names}

    def test_it_follows_the_law_of_the_labels(self):
        lower = LowerEnergy.of(self.Split(), least=0.3)
        frame = make_frame(7, light=1500.0)
        seen = []
        for one in redraw(lower, frame, 40):
            lit = np.isfinite(frame["true_range_m"])
            factor = np.unique(np.round(one["photons"][lit] / frame["photons"][lit], 4))
            assert len(factor) == 1 and 0.3 <= factor[0] <= 1.0
            seen.append(factor[0])
            light = one["photons"][lit].astype(float)
            wanted = 1.0 / (1.0 + np.exp(-(light - 800.0) / 150.0))
            assert np.abs(one["detection_probability"][lit] - wanted).mean() < 0.02
            np.testing.assert_allclose(one["range_sigma_m"][lit], 0.05 + 60.0 / light, rtol=0.1)
            assert (one["detection_probability"] <= frame["detection_probability"]).all()
        assert min(seen) < 0.4 and max(seen) > 0.8

    def test_counts_fall_with_the_light(self):
        lower = LowerEnergy.of(self.Split(), least=0.3)
        frame = make_frame(7, light=20_000.0, noisy=False)
        for one in redraw(lower, frame, 10):
            of = np.isfinite(one["range_m"]) & (one["photons"] > 4000.0)
            assert np.median(one["intensity_counts"][of] / one["photons"][of]) == pytest.approx(
                COUNTS_PER_PHOTON, rel=0.1
            )

    def test_another_sensor_is_needed(self):
        with pytest.raises(rl.DatasetError, match="no frame of sensor 5 has light"):
            LowerEnergy.of(self.Split(), sensor=5)


def project(frame, points):
    """Return the pixels (point, row_col) of points in target axes."""
    seen = Rotation.from_quat(frame["quaternion_xyzw"]).apply(points) + frame["position_m"]
    fx, fy, cx, cy = frame["intrinsics_px"]
    return np.stack([fy * seen[:, 1] / seen[:, 2] + cy, fx * seen[:, 0] / seen[:, 2] + cx], axis=1)


@pytest.mark.parametrize("turns", range(4))
def test_pose_box_and_sun_turn_with_the_image(turns):
    frame = make_frame()
    points = np.random.default_rng(3).normal(0.0, 3.0, (20, 3))
    pixels = project(frame, points)
    turned = turn_frame(frame, turns)
    expected = pixels
    for _ in range(turns):  # counterclockwise: a column becomes a row from the top
        expected = np.stack([N - 1 - expected[:, 1], expected[:, 0]], axis=1)
    np.testing.assert_allclose(project(turned, points), expected, atol=1e-9)
    assert np.isclose(np.linalg.norm(turned["quaternion_xyzw"]), 1.0) and turned["quaternion_xyzw"][3] >= 0.0
    before, after = (np.argwhere(one["part_class_id"] >= 0) for one in (frame, turned))
    assert len(before) == len(after)
    np.testing.assert_array_equal(turned["box_px"], [*after.min(axis=0), *after.max(axis=0)])
    # Where the Sun's direction would be seen turns as the points do.
    for one, wanted in ((frame, 0.6), (turned, [0.6, 0.0, -0.6, 0.0][turns])):
        assert one["sun_direction"][0] == pytest.approx(wanted)
    again = turn_frame(turned, 4 - turns) if turns else turned
    for name, values in frame.items():
        np.testing.assert_allclose(again[name], values, atol=1e-12)


def test_turns_are_random_and_need_a_centred_square():
    frame = make_frame()
    first = {tuple(QuarterTurns()(dict(frame), np.random.default_rng(k))["box_px"].tolist()) for k in range(20)}
    assert len(first) == 4
    steep = frame | {"normal": np.tile(np.array([0.6, 0.0, -0.8], np.float32), (*frame["range_m"].shape, 1))}
    sides = {tuple(QuarterTurns()(dict(steep), np.random.default_rng(k))["normal"][0, 0].tolist()) for k in range(20)}
    assert len(sides) == 4
    beside = frame | {"intrinsics_px": np.array([F_PX, F_PX, 15.5, 14.0])}
    with pytest.raises(rl.DatasetError, match="square array about the boresight"):
        QuarterTurns()(beside, np.random.default_rng(0))


def test_a_mirror_image_has_no_attitude():
    frame = make_frame()
    with pytest.raises(rl.DatasetError, match="leave out quaternion_xyzw"):
        MirrorImages()(dict(frame), np.random.default_rng(0))
    del frame["quaternion_xyzw"]
    mirrored = mirror_frame(frame)
    np.testing.assert_array_equal(mirrored["range_m"], np.fliplr(frame["range_m"]))
    np.testing.assert_array_equal(mirrored["position_m"], [-2.0, -1.5, 500.0])
    after = np.argwhere(mirrored["part_class_id"] >= 0)
    np.testing.assert_array_equal(mirrored["box_px"], [*after.min(axis=0), *after.max(axis=0)])
    rng = np.random.default_rng(0)
    drawn = np.array([MirrorImages()(dict(frame), rng)["position_m"][0] for _ in range(400)])
    assert set(drawn) == {-2.0, 2.0}
    assert abs((drawn < 0.0).mean() - 0.5) < 4 * np.sqrt(0.25 / 400)  # one in two
