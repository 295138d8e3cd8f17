import dataclasses

import numpy as np
import pytest

from rso_lidar.picture import curve_figure, save_figure
from rso_lidar.picture.plots.curves import FrameStatistics
from rso_lidar.records import Reading


def test_a_point_counts_what_is_there(handmade):
    frame = handmade.make_frame(0.0, 1500.0, 64, photons_at_km=60_000.0, false_returns=6)
    point = FrameStatistics.of(frame)
    there = frame.labels.target >= 0
    assert point.lit == there.sum()
    assert point.detected + point.false == frame.valid.sum()
    assert 0 < point.photons_10 < point.photons_50 < point.photons_90 <= frame.labels.photons.max()
    assert point.true_range_m == pytest.approx(np.linalg.norm(frame.truth.pose("lidar", "tdrs").translation))


def test_errors_are_those_of_pixels_with_one_cluster(handmade):
    frame = handmade.make_frame(0.0, 400.0, 64, photons_at_km=60_000.0)
    reading = frame.observation.reading
    counts = frame.labels.cluster_count.copy()
    several = (np.arange(counts.size).reshape(counts.shape) % 3 == 0) & (counts > 0)
    counts[several] = 2
    range_m = np.where(several, frame.labels.range_m + 9.0, frame.labels.range_m + 0.25)
    moved = Reading(range_m, reading.intensity_counts, reading.saturated)
    frame = dataclasses.replace(
        frame,
        observation=dataclasses.replace(frame.observation, reading=moved),
        labels=dataclasses.replace(frame.labels, cluster_count=counts),
    )
    point = FrameStatistics.of(frame)
    # float32 ranges at 400 m are 15 um apart at most
    assert (point.error_16_m, point.error_50_m, point.error_84_m) == pytest.approx((0.25,) * 3, abs=3e-5)


def test_a_dark_frame_has_nothing_to_say(handmade):
    point = FrameStatistics.of(handmade.make_frame(0.0, 900.0, 32, photons_at_km=0.0, labelled=False, false_returns=0))
    assert (point.lit, point.detected, point.false) == (0, 0, 0)
    assert np.isnan([point.measured_m, point.photons_50, point.error_50_m]).all()


def test_curves_over_an_approach(handmade, tmp_path):
    figure = curve_figure(handmade.approach(12, n=64))
    ranges, share, photons, errors = figure.axes[:4]
    np.testing.assert_allclose(ranges.lines[1].get_ydata(), ranges.lines[0].get_ydata(), atol=6.5)
    detected = share.lines[0].get_ydata()
    assert detected[0] < detected[-1]
    assert detected[-1] > 0.95
    assert ranges.get_ylim()[1] > 1.05 * ranges.lines[0].get_ydata().max()
    assert photons.get_yscale() == "log"
    assert errors.get_xlabel() == "Time [s]"
    assert save_figure(figure, tmp_path / "curves.png").stat().st_size > 20_000


def test_curves_of_nothing_seen(handmade, tmp_path):
    dark = [
        handmade.make_frame(float(k), 900.0, 16, photons_at_km=0.0, labelled=False, false_returns=0) for k in range(3)
    ]
    assert save_figure(curve_figure(iter(dark)), tmp_path / "dark.png").is_file()


def test_one_frame_is_drawn_as_marks(handmade):
    """A line of one point would show nothing, and an axis of photons over a tenth of a decade only rounding."""
    figure = curve_figure([handmade.make_frame(0.0, 1500.0, 64, photons_at_km=60_000.0)])
    figure.canvas.draw()
    assert any(text.get_text().startswith("1 frame ") for text in figure.texts)
    for axes in figure.axes:
        lines = [one for one in axes.get_lines() if len(one.get_xdata()) == 1]
        assert all(one.get_marker() != "None" for one in lines), axes.get_ylabel()
    photons = next(axes for axes in figure.axes if axes.get_ylabel().startswith("Expected"))
    assert photons.get_ylim()[1] / photons.get_ylim()[0] >= 10.0
