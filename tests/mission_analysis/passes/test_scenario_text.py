"""When the scenario of an encounter begins and ends."""

import datetime

import pytest

from rso_lidar.mission_analysis.passes.scenario_lines import choose_run

START = datetime.datetime(2026, 11, 29, tzinfo=datetime.UTC)


@pytest.mark.parametrize(
    ("span_s", "begins_s", "lasts_s"),
    [
        ((7000.0, 7010.0), 6995, 21.0),  # with five seconds before and after
        ((6450.0, 7100.0), 6445, 661.0),
        ((0.0, 86400.0), 6400, 1201.0),  # of a craft that stays: twenty minutes about the closest approach
        ((6900.0, 7100.0), 6895, 211.0),
    ],
)
def test_a_scenario_spans_the_encounter_with_margins(span_s, begins_s, lasts_s):
    assert choose_run(START, span_s, 7000.0) == (START + datetime.timedelta(seconds=begins_s), lasts_s)
