"""Labels of a frame for learning: boxes, lit and reporting pixels, common part classes."""

from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset import label_frame
from rso_lidar.dataset.annotation.frame_labels import number_part_classes
from rso_lidar.errors import RecordError
from rso_lidar.records import PART_CLASSES, find_box

CLASSES = tuple(PART_CLASSES)
BENCH = """
version = 1
name = "two plates"
seed = 3
world = {{ axes = "local" }}
[time]
start_utc = 2024-01-01T00:00:00Z
duration_s = 1
frame_rate_hz = 1
[[target]]
name = "near"
model = "plate"
size_m = 2.0
part_classes = {{ plate = "solar_array" }}
motion = {{ type = "fixed", position_m = [{near_m}, {near_y_m}, 0] }}
[[target]]
name = "far"
model = "cubesat_3u"
size_m = 6.0
motion = {{ type = "fixed", position_m = [200, {far_y_m}, 0] }}
[follower]
motion = {{ type = "fixed", position_m = [0, 0, 0] }}
attitude = {{ type = "fixed" }}
[lidar.receiver]
fov_deg = 5
f_number = 2.8
n_rows = 64
n_cols = 64
rays_per_pixel = 16
[lidar.laser]
divergence_deg = 6
"""


def fly(near_m=100.0, far_y_m=-6.0, text="", near_y_m=0.0):
    scenario = rl.Scenario.loads(BENCH.format(near_m=near_m, far_y_m=far_y_m, near_y_m=near_y_m) + text)
    frame = next(rl.simulate(scenario, frames=[0], threads=1, keep=("hits", "signal", "photons")))
    return scenario, frame


def test_labels_agree_with_the_frame_s_own():
    scenario, frame = fly()
    for number, name in enumerate(("near", "far")):
        made = label_frame(frame, scenario, number)
        alone = frame.labels.target == number  # pixels that both share are few
        rows, cols = np.nonzero(alone & (frame.labels.photons >= 1.0))
        assert made.box_px.tolist() == pytest.approx([rows.min(), cols.min(), rows.max(), cols.max()], abs=1)
        assert made.lit_pixels == pytest.approx(len(rows), rel=0.05)
        assert made.total_photons == pytest.approx(frame.labels.photons[alone].sum(), rel=0.05)
        assert made.range_to_target_m == pytest.approx(np.linalg.norm(frame.truth.pose("lidar", name).translation))
        assert made.part_light_fraction.sum() == pytest.approx(1.0)
    both = [label_frame(frame, scenario, number).total_photons for number in (0, 1)]
    assert sum(both) == pytest.approx(float(frame.labels.photons.sum()), rel=1e-6)


def test_pixels_have_the_class_of_their_part():
    scenario, frame = fly()
    made = label_frame(frame, scenario, 0)
    entry = rl.scene.library.model("cubesat_3u")
    for part, name in enumerate(scenario.source.targets[1].parts):
        of = (frame.labels.target == 1) & (frame.labels.part == part)
        assert set(np.unique(made.part_class_id[of])) <= {CLASSES.index(entry.part_classes[name])}
    assert set(np.unique(made.part_class_id[frame.labels.target == 0])) == {CLASSES.index("solar_array")}
    assert (made.part_class_id == -1).sum() == (frame.labels.target == -1).sum() > 0
    assert made.part_light_fraction[CLASSES.index("solar_array")] == 1.0


def test_reporting_pixels_are_those_that_report_the_target_and_not_another():
    scenario, frame = fly(near_m=100.0, far_y_m=0.0)  # one before the other
    made = [label_frame(frame, scenario, number) for number in (0, 1)]
    near = np.abs(frame.range_m - 100.0) < 5.0
    assert made[0].reporting_pixels == near.sum() > 100
    assert made[1].reporting_pixels < made[0].reporting_pixels
    blind = replace(frame.observation.reading, range_m=np.full(frame.range_m.shape, np.nan, np.float32))
    nothing = replace(frame, observation=replace(frame.observation, reading=blind))
    assert label_frame(nothing, scenario, 0).reporting_pixels == 0


def test_a_frame_without_a_target_has_no_box():
    scenario, frame = fly()
    made = label_frame(frame, scenario, None)
    assert (made.lit_pixels, made.reporting_pixels, made.total_photons) == (0, 0, 0.0)
    assert made.box_px.tolist() == [-1, -1, -1, -1]
    assert np.isnan(made.range_to_target_m)
    assert np.isnan(made.part_light_fraction).all()
    assert (made.part_class_id >= 0).any()  # clutter keeps its classes


def test_a_target_out_of_the_field_is_not_lit():
    scenario, frame = fly(far_y_m=80.0)
    made = label_frame(frame, scenario, 1)
    assert made.lit_pixels == 0
    assert made.box_px.tolist() == [-1] * 4
    assert np.isnan(made.part_light_fraction).all()


def test_ghost_images_of_the_lens_are_not_lit():
    text = "\n[[lidar.receiver.ghosts]]\nfraction = 0.01\noffset_pixels = [20, 0]\n"
    scenario, frame = fly(text=text)
    _, plain = fly()
    made, wanted = label_frame(frame, scenario, 0), label_frame(plain, scenario, 0)
    assert frame.kept["photons"].photons.sum() > 1.005 * plain.kept["photons"].photons.sum()
    assert made.lit_pixels == wanted.lit_pixels
    assert made.box_px.tolist() == wanted.box_px.tolist()


def test_box_of_marked_pixels():
    marked = np.zeros((5, 7), bool)
    marked[1, 4] = marked[3, 2] = True
    assert find_box(marked).tolist() == [1, 2, 3, 4]
    assert find_box(np.zeros((5, 7), bool)).tolist() == [-1] * 4


def test_old_recordings_have_the_class_other():
    scenario, _ = fly()
    old = replace(scenario.source, targets=tuple(replace(one, part_classes=()) for one in scenario.source.targets))
    assert (number_part_classes(old, CLASSES) == CLASSES.index("other")).all()
    assert set(np.unique(number_part_classes(scenario.source, ("other", "bus")))) == {0, 1}


def test_what_cannot_be_labelled_is_one_line():
    scenario, frame = fly()
    with pytest.raises(RecordError, match=r"lacks hits; simulate with keep"):
        label_frame(replace(frame, kept={"signal": frame.kept["signal"]}), scenario, 0)
    with pytest.raises(RecordError, match="no target 2; there are 2"):
        label_frame(frame, scenario, 2)
