"""Pictures over time, of an encounter and of trackers: each panel has its legend, where it covers nothing."""

import numpy as np

from rso_lidar.evaluation.track_quality.tracking_figure import tracking_figure
from rso_lidar.mission_analysis.time_history.timeline_figure import timeline_figure

TIME_S = np.arange(50.0)
FLAT = np.full(50, 0.5)


def encounter(**columns):
    names = (
        "range_m", "range_rate_m_s", "line_of_sight_rate_rad_s", "azimuth_rate_rad_s", "elevation_rate_rad_s",
        "pan_demand_rad", "pan_actual_rad", "pan_demand_rate_rad_s", "pan_rate_rad_s", "tilt_demand_rad",
        "tilt_actual_rad", "tilt_demand_rate_rad_s", "tilt_rate_rad_s", "off_boresight_rad", "in_field_fraction",
        "width_pixels", "height_pixels", "target_pixels", "brightest_photons", "median_photons",
        "detection_probability", "found_probability", "expected_returns", "phase_rad", "sun_off_boresight_rad",
    )  # fmt: skip
    table = {"time_s": TIME_S, "utc": np.array(["2024-09-17T12:00:00Z"] * 50)} | dict.fromkeys(names, FLAT)
    flags = ("pan_beyond_travel", "tilt_beyond_travel", "pan_at_greatest_rate", "tilt_at_greatest_rate")
    return table | dict.fromkeys(flags, np.zeros(50, int)) | {"cast": np.ones(50, int)} | columns


def legend_words(figure):
    return [[text.get_text() for text in axes.get_legend().get_texts()] for axes in figure.axes if axes.get_legend()]


def test_the_greatest_rate_stands_in_the_legend_of_its_panel():
    """30 deg/s beside rates of 29 deg/s is drawn, beside none at all it is said to be beyond."""
    for rate_deg_s, said in ((29.0, "greatest rate ±30°/s"), (0.0, "greatest rate ±30°/s, beyond the axis")):
        rate = np.full(50, np.radians(rate_deg_s))
        rates = {f"{axis}{word}_rate_rad_s": rate for axis in ("pan", "tilt") for word in ("", "_demand")}
        figure = timeline_figure(encounter(**rates), "body", "a", max_rate_rad_s=np.radians(30.0))
        assert any(said in words for words in legend_words(figure))
        assert not any(axes.get_title(loc="right") for axes in figure.axes)  # no label floats between panels
    unlimited = timeline_figure(encounter(), "body", "a")
    assert not any("greatest" in word for words in legend_words(unlimited) for word in words)


def test_no_curve_of_a_timeline_runs_through_a_legend():
    """A steep ramp takes all of every panel but the room of the legend."""
    ramp = np.linspace(1e-3, 1.0, 50)[::-1]
    figure = timeline_figure(encounter(pan_rate_rad_s=ramp, phase_rad=3.0 * ramp, brightest_photons=1e5 * ramp), "body")
    figure.canvas.draw()
    for axes in figure.axes:
        if axes.get_legend():
            foot = axes.get_legend().get_window_extent().y0
            for line in axes.get_lines():
                points = axes.transData.transform(line.get_xydata())
                assert np.nanmax(points[:, 1], initial=0.0) <= foot + 2.0, axes.get_ylabel()


def test_every_panel_of_a_tracking_picture_has_a_legend_or_shares_one_and_ticks_meet_no_others():
    rng = np.random.default_rng(4)
    table = {"time_s": TIME_S, "true_range_m": 1e3 - TIME_S, "centroid_range_m": 1e3 - TIME_S, "points": 40.0 + TIME_S}
    for name in ("centroid", "cv", "cw"):
        table |= {f"{name}_error_{axis}_m": 10.0 * rng.normal(size=50) for axis in ("right", "down", "ahead")}
    table |= {f"{kind}_nis": rng.chisquare(3, 50) for kind in ("cv", "cw")}
    icp = ("icp_error_rad", "icp_long_axis_error_rad", "icp_error_m", "icp_rms_m")
    table |= {name: 10.0 ** rng.uniform(-4, 2, 50) for name in icp}
    figure = tracking_figure(table, ("cv", "cw"), "body", "a" * 200, "note")
    figure.canvas.draw()
    words = legend_words(figure)
    assert words[0] == ["true range", "range of the centroid", "points (right)"]
    assert len(words) == 5 and "constant velocity" in words[1]
    panels = [axes for axes in figure.axes if axes.get_ylabel() != "Points"]
    boxes = []
    for axes in panels:
        low, high = axes.get_ylim()
        ticks = [t for t, at in zip(axes.get_yticklabels(), axes.get_yticks(), strict=True) if low <= at <= high]
        assert len([tick for tick in ticks if tick.get_text()]) >= 2, axes.get_ylabel()
        boxes += [tick.get_window_extent() for tick in ticks if tick.get_text()]
    assert not [1 for k, box in enumerate(boxes) for other in boxes[k + 1 :] if box.overlaps(other)]
