"""Boxes of targets and parts, from the labels of pixels."""

import numpy as np

from rso_lidar.records import CameraLabels, LabelBox, find_boxes


def test_boxes_hold_the_pixels_of_a_target_or_of_a_part():
    target, part = np.full((6, 8), -1), np.full((6, 8), -1)
    target[1:3, 2:6], part[1:3, 2:6] = 0, 1
    part[2, 5] = 3
    target[4, 7], part[4, 7] = 2, 0
    empty = np.zeros((6, 8))
    labels = CameraLabels(electrons=empty[..., None], target=target, part=part, range_m=empty, filled_fraction=empty)
    assert find_boxes(labels) == [LabelBox(0, None, (1, 2, 2, 5), 8), LabelBox(2, None, (4, 7, 4, 7), 1)]
    assert find_boxes(labels, by_part=True) == [
        LabelBox(0, 1, (1, 2, 2, 5), 7),
        LabelBox(0, 3, (2, 5, 2, 5), 1),
        LabelBox(2, 0, (4, 7, 4, 7), 1),
    ]
