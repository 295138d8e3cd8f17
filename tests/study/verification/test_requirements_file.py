"""The requirements file: what it refuses, in one line that names the place and the cure."""

import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.study import Requirements
from rso_lidar.study.verification.quantities import find_quantity
from tests.study.verification.requirements_for_tests import FILE

BROKEN = {
    ("at_least   = 0.5", "at_leest   = 0.5"): "did you mean 'at_least'?",
    ("at_least   = 0.5", ""): "has no bound; give exactly one of at_least, at_most and within",
    ("at_least   = 0.5", "at_least = 0.5\nat_most = 0.9"): "has both at_least and at_most",
    ("at_least   = 0.5", "within = [0.9, 0.5]"): "within: 0.9 is not below 0.5; give the lower one first",
    ("at_least   = 0.5", 'at_least = "0.5"'): "at_least",
    ("at_least   = 0.5", "at_least = nan"): "at_least",
    ('"detection_fraction"', '"detection_fracton"'): "did you mean 'detection_fraction'?",
    ('"detection_fraction"', '"budget.precision"'): "a budget has no column 'precision'",
    ('"detection_fraction"', '"finding.range_m"'): "did you mean 'finding.max_range_m'?",
    ('"detection_fraction"', '"budget.range_precision_m"'): "range_m: is missing; 'budget.range_precision_m' needs it",
    ('"detection_fraction"', '"timeline.range_m"'): "statistic: is missing; 'timeline.range_m' needs it (mean, rms",
    ('"detection_fraction"', '"tracking.icp_error_m"\nstatistic = "greatest"'): "take p95 or rms",
    ('"detection_fraction"', '"time_in_field_s"\nframes = "0:4"'): "frames: is no condition of 'time_in_field_s'",
    ("confidence = 0.9", ""): "confidence: is missing; 'detection_fraction' depends on noise",
    ("confidence = 0.9", "confidence = 95"): "confidence",
    ("confidence = 0.9", "confidence = 0.5"): "confidence",
    ("confidence = 0.9", "confidence = 0.9\nrange_m = 300"): "range_m: is no condition of 'detection_fraction'",
    ("confidence = 0.9", 'confidence = 0.9\nframes = "first"'): "needs text such as '0:2700:100'",
    ("confidence = 0.9", "confidence = 0.9\nbetween_m = [500, 300]"): "between_m: 500 is not below 300",
    ('source   = "nobody"', "confidence = 0.9"): "is computed without noise; leave it out",
    ('"A-2"', '"A-1"'): "the id 'A-1' is given twice",
    ('"A-2"', '"A 2"'): "id",
    ('"inspection"', '"simulation"'): "verification",
    ("version = 1", "version = 2"): "version",
    ('name    = "A plate"', ""): "name",
    ("[[requirement]]", "[[requirements]]"): "did you mean 'requirement'?",
}


def test_a_good_file_is_read():
    asked = Requirements.loads(FILE)
    assert [one.id for one in asked.requirement] == ["A-1", "A-2"]
    assert asked.requirement[0].limits == (0.5, float("inf")) and asked.requirement[0].needs_frames
    assert asked.requirement[1].margin(2e-6, 2e-6) == pytest.approx(-1e-6)


@pytest.mark.parametrize(("old", "new"), BROKEN)
def test_a_bad_one_is_refused_in_one_line(old, new):
    assert old in FILE
    with pytest.raises(ScenarioError) as told:
        Requirements.loads(FILE.replace(old, new), where="reqs.toml")
    assert "\n" not in str(told.value) and str(told.value).startswith("reqs.toml: ")
    assert BROKEN[old, new] in str(told.value)


def test_quantities_have_the_units_of_their_studies():
    units = {name: find_quantity(name).unit for name in ("range_error_m", "budget.pixels_on_target", "budget.snr")}
    assert units == {"range_error_m": "m", "budget.pixels_on_target": "pixels", "budget.snr": "1"}
    assert find_quantity("timeline.image_rate_rad_s").unit == "rad/s"
    assert find_quantity("tracking.cv_velocity_error_ahead_m_s").is_random
    assert not find_quantity("pixels_on_target").is_random
