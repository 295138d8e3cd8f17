import re

import numpy as np
import pytest

from rso_lidar.detector import FittedConstant, FittedCurve, MeasuredCurve
from rso_lidar.errors import RecordingError
from rso_lidar.evaluation import CurvesFile, fit_camera, save_fit_report
from rso_lidar.evaluation.camera_calibration.fit_report import draw_camera_fit, write_fit_report
from rso_lidar.scenario import Scenario
from tests.evaluation.camera_calibration.bench_for_tests import CURVES, make_table, write_bench


def fit_bench(folder, columns=None):
    write_bench(folder, CURVES, columns)
    return fit_camera(Scenario.load(folder / "bench.toml").lidar, CurvesFile.load(folder / "curves.toml"))


@pytest.fixture(scope="module")
def camera(tmp_path_factory):
    return fit_bench(tmp_path_factory.mktemp("bench"))


def test_the_picture_has_measured_points_over_both_lines_and_residuals_below(camera):
    above, below = draw_camera_fit(camera).axes
    before, fitted, measured = above.get_lines()[:3]
    (curve,) = camera.fit.curves
    order = np.argsort(curve.curve.photons)
    assert np.allclose(fitted.get_ydata(), curve.expected[order])
    assert np.allclose(before.get_ydata(), curve.before[order])
    assert sorted(measured.get_ydata()) == sorted(curve.curve.value)
    assert any(np.array_equal(line.get_ydata(), curve.residuals) for line in below.get_lines())


def test_the_page_has_constants_curves_and_points(camera):
    page = write_fit_report(camera)
    assert "<b>Accepted.</b>" in page
    assert "Nothing that these measurements show" in page
    for constant in camera.fit.constants:
        assert f"<code>{constant.name}</code>" in page
    assert (
        page.count("<tr>") == 2 + 1 + 2 + 1 + 1 + 1 + 12 + 1
    )  # constants, correlations, curves and points, with headings
    assert camera.hashes[0][:16] in page


def test_the_page_of_a_rejected_fit_says_what_is_not_reproduced(tmp_path):
    columns = make_table()
    columns["hits"][::2] *= 0.8
    page = write_fit_report(fit_bench(tmp_path, columns))
    assert "<b>Rejected.</b>" in page
    assert re.search(r"measured, [0-9.]+ simulated at [0-9.]+ photons", page)


def test_reports_are_written_by_their_suffix(camera, tmp_path):
    assert save_fit_report(camera, tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert save_fit_report(camera, tmp_path / "a.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    with pytest.raises(RecordingError, match="exists"):
        save_fit_report(camera, tmp_path / "a.png")
    with pytest.raises(RecordingError, match="docx"):
        save_fit_report(camera, tmp_path / "a.docx")


def test_every_quantity_has_its_panel(camera):
    import dataclasses

    n = 3
    curves = []
    for quantity in ("range_mean", "walk", "counts_mean", "counts_scatter", "range_scatter", "dark_counts"):
        value = np.array([1.0, 2.0, 3.0])
        curve = MeasuredCurve(quantity, quantity, value * 100.0, value, value * 9.0, value, value * 50.0, 0.0 * value)
        curves.append(FittedCurve(curve, value * 1.1, value * 0.9, np.array([-0.5, 0.0, 1.0]), n, 0.5))
    scale = FittedConstant("photons_scale", 1.0, 0.9, 1.1, 1.0)
    other = dataclasses.replace(camera, fit=dataclasses.replace(camera.fit, curves=tuple(curves), photons_scale=scale))
    figure = draw_camera_fit(other)
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert titles == ["Mean error of range [cm]", "Range walk [cm]", "Mean intensity [counts]",
                      "Scatter of intensity [counts]", "Scatter of range [cm]", "Triggers in the dark"]  # fmt: skip
    assert "photons_scale" in other.table()
