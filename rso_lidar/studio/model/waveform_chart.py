"""The waveform of a pixel as a chart of Apache ECharts: options as a browser takes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rso_lidar.picture import Scheme

_LEGEND_PX, _ROW_PX = 42, 13  # heights of the legend's two rows, and of a row of labels


def make_waveform_chart(
    curves: Mapping[str, np.ndarray], instants_ns: Mapping[str, float], note: str, scheme: Scheme
) -> dict[str, Any]:
    """Make the options of the chart of a waveform.

    Parameters
    ----------
    curves : parts of the waveform by name, each (n, 2): time since emission [ns] and counts; of names that begin with
        "light", photoelectrons per step
    instants_ns : instants to be marked, by name [ns since emission]: truth, reported, trigger
    scheme : `LIGHT` or `DARK`
    """
    words = {"color": scheme.quiet}
    title = {"text": note, "textStyle": {**words, "fontSize": 12, "fontWeight": "normal"}}
    if not curves:
        return {"title": title}
    axis = {
        "nameLocation": "middle",
        "scale": True,
        "axisLabel": words,
        "nameTextStyle": words,
        "splitLine": {"show": False},
    }
    # Above the curves, each in a row of its own: truth and report are often within a nanosecond.
    styles = {"truth": (scheme.lines[2], "solid"), "reported": (scheme.lines[5], "dashed")}
    marks = []
    for k, (name, at) in enumerate(instants_ns.items()):
        colour, kind = styles.get(name, (scheme.mark, "dotted"))
        label = {"formatter": name, "position": "end", "distance": 2 + _ROW_PX * k, "color": colour}
        marks.append({"xAxis": at, "label": label, "lineStyle": {"color": colour, "type": kind}})
    top = _LEGEND_PX + _ROW_PX * len(marks)
    series = []
    for k, (name, curve) in enumerate(curves.items()):
        line = {"name": name, "type": "line", "data": curve.round(4).tolist(), "showSymbol": name == "samples"}
        line |= {"color": scheme.lines[k % 6], "yAxisIndex": int(name.startswith("light")), "animation": False}
        line["lineStyle"] = {"width": 1.4, "type": "dashed" if name in ("threshold", "reported pulse") else "solid"}
        if name == "samples":
            line["markLine"] = {"symbol": "none", "animation": False, "data": marks}
        series.append(line)
    start, end = curves["samples"][[0, -1], 0]
    return {
        "grid": {"left": 60, "right": 55, "top": top, "bottom": 38},
        "legend": {"textStyle": {**words, "fontSize": 11}, "top": 0, "itemWidth": 16, "itemGap": 8},
        "tooltip": {"trigger": "axis"},
        "xAxis": {
            **axis,
            "type": "value",
            "name": "time since emission [ns]",
            "nameGap": 24,
            "min": start,
            "max": end,
            "axisLabel": {**words, "showMinLabel": False, "showMaxLabel": False},  # the ends are no round numbers
        },
        "yAxis": [
            {**axis, "name": "counts", "nameGap": 44},
            {**axis, "name": "photoelectrons per step", "nameGap": 38},
        ],
        "series": series,
    }
