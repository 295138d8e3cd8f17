"""The chart of a waveform, as the options that a browser gets."""

import numpy as np

from rso_lidar.picture import LIGHT
from rso_lidar.studio.model.waveform_chart import make_waveform_chart

CURVES = {
    "samples": np.array([[2000.0, 10.0], [2004.0, 250.0], [2008.0, 30.0]]),
    "light on the pixel": np.array([[2001.0, 0.0], [2003.0, 7.0]]),
    "threshold": np.array([[2000.0, 90.0], [2008.0, 90.0]]),
}


def test_instants_stand_in_rows_with_a_line_and_a_colour_of_their_own():
    chart = make_waveform_chart(CURVES, {"truth": 2002.5, "trigger": 2003.0, "reported": 2002.75}, "pixel 3, 4", LIGHT)
    samples, *others = chart["series"]
    marks = samples["markLine"]["data"]
    assert [(mark["label"]["formatter"], mark["xAxis"]) for mark in marks] == [
        ("truth", 2002.5),
        ("trigger", 2003.0),
        ("reported", 2002.75),
    ]
    assert [tuple(mark["lineStyle"].values()) for mark in marks] == [
        (LIGHT.lines[2], "solid"),
        (LIGHT.mark, "dotted"),
        (LIGHT.lines[5], "dashed"),
    ]
    heights = [mark["label"]["distance"] for mark in marks]
    assert np.diff(heights).tolist() == [13, 13] and chart["grid"]["top"] > heights[-1]
    assert not any("markLine" in series for series in others)


def test_light_has_an_axis_of_its_own_and_the_samples_span_the_time():
    chart = make_waveform_chart(CURVES, {}, "", LIGHT)
    assert {series["name"]: series["yAxisIndex"] for series in chart["series"]} == {
        "samples": 0,
        "light on the pixel": 1,
        "threshold": 0,
    }
    assert (chart["xAxis"]["min"], chart["xAxis"]["max"]) == (2000.0, 2008.0)
    assert chart["series"][2]["lineStyle"]["type"] == "dashed" and chart["series"][0]["data"][1] == [2004.0, 250.0]
    assert make_waveform_chart({}, {}, "no light", LIGHT) == {
        "title": {"text": "no light", "textStyle": {"color": LIGHT.quiet, "fontSize": 12, "fontWeight": "normal"}}
    }
