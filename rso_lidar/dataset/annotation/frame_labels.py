"""Labels of one frame for learning: what is visible of one target, and the common part class of each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from rso_lidar.detector import mark_reports
from rso_lidar.errors import RecordError
from rso_lidar.records import OTHER, PART_CLASSES, Frame, Hits, Photons, Record, Source, array, find_box
from rso_lidar.scenario import Scenario

LEAST_PHOTONS = 1.0  # expected photons of the target in a lit pixel, at least; a choice


@dataclass(frozen=True, eq=False, repr=False)
class FrameLabels(Record):
    """Labels of one frame for learning.

    They describe one target; all others are clutter. Without a target there are no lit pixels, the box is -1, and range
    and shares are NaN. `part_class_id` covers all targets. `range_to_target_m` [m] is the distance of the target's origin
    from the lidar.
    """

    lit_pixels: int
    reporting_pixels: int
    total_photons: float
    range_to_target_m: float
    part_class_id: np.ndarray = array("row col", "i1", "1", "common part class that returns most light, -1 for sky")
    box_px: np.ndarray = array(
        "edge", "i2", "1", "first row, first col, last row and last col of the lit pixels, or -1"
    )
    part_light_fraction: np.ndarray = array(
        "part_class", "f4", "1", "share of the target's photons that each common part class returns"
    )


def label_frame(
    frame: Frame, scenario: Scenario, target: int | None, part_classes: Sequence[str] = tuple(PART_CLASSES)
) -> FrameLabels:
    """Label a frame for learning.

    Parameters
    ----------
    frame : frame that was simulated with ``keep=("hits", "signal")``
    scenario : of the frame
    target : number of the target that the labels describe, or None where the frame has none
    part_classes : names of the common part classes, in the order in which they are numbered

    Returns
    -------
    FrameLabels
        A pixel is lit if it has at least one expected photon of the target. It reports the target if its reported range
        is near the range of the target's light in that pixel.

    Raises
    ------
    RecordError
        If the frame lacks its hits or signal, or there is no target of this number.
    """
    missing = [name for name in ("hits", "signal") if name not in frame.kept]
    if missing:
        raise RecordError(
            f"label_frame: the frame lacks {' and '.join(missing)}; simulate with keep=('hits', 'signal')"
        )
    source = scenario.source
    if target is not None and not 0 <= target < len(source.targets):
        raise RecordError(f"label_frame: no target {target}; there are {len(source.targets)}, numbered from 0")
    hits, photons = cast(Hits, frame.kept["hits"]), cast(Photons, frame.kept["signal"])
    class_of = number_part_classes(source, part_classes)
    of_target, of_part = frame.labels.target, frame.labels.part
    classes = np.where(of_target >= 0, class_of[of_target, of_part], -1)
    if target is None:
        return FrameLabels(
            lit_pixels=0,
            reporting_pixels=0,
            total_photons=0.0,
            range_to_target_m=np.nan,
            part_class_id=classes,
            box_px=np.full(4, -1),
            part_light_fraction=np.full(len(part_classes), np.nan),
        )
    mine = hits.target[photons.hit] == target
    light = photons.photons[mine]
    by_pixel = np.bincount(photons.pixel[mine], light, classes.size).reshape(classes.shape)
    is_lit, reports = by_pixel >= LEAST_PHOTONS, mark_reports(frame.observation.reading, photons, mine)
    by_class = np.bincount(class_of[target, hits.part[photons.hit[mine]]], light, len(part_classes))
    place_m, _ = frame.truth.poses.place("lidar", source.targets[target].name)
    return FrameLabels(
        lit_pixels=int(is_lit.sum()),
        reporting_pixels=int(reports.sum()),
        total_photons=float(by_pixel.sum()),
        range_to_target_m=float(np.linalg.norm(place_m)),
        part_class_id=classes,
        box_px=find_box(is_lit),
        part_light_fraction=by_class / by_class.sum() if by_class.any() else np.full(len(part_classes), np.nan),
    )


def number_part_classes(source: Source, part_classes: Sequence[str]) -> np.ndarray:
    """Return the number of the common class of each part (target, part) of a recording.

    All parts of a recording without part classes, and parts whose class is not in the list, get the number of `other`.
    """
    numbers = {name: number for number, name in enumerate(part_classes)}
    most = max((len(target.parts) for target in source.targets), default=0)
    classes = np.full((max(len(source.targets), 1), max(most, 1)), numbers[OTHER], np.int8)
    for row, target in zip(classes, source.targets, strict=False):
        for part, name in enumerate(target.part_classes):
            row[part] = numbers.get(name, numbers[OTHER])
    return classes
