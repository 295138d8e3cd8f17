"""A frame drawn beside that of another recording, by the colours that span both, and its targets marked where they are."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.picture import LIGHT
from rso_lidar.studio.model.frame_drawing import draw_recorded_frame, locate_centers
from rso_lidar.studio.model.frame_image import draw_image

BENCH = rl.Scenario.load("examples/bench_plate.toml")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Return recordings of one frame by a full and by a weak laser, and of another frame."""
    folder = tmp_path_factory.mktemp("recordings")
    weak = BENCH.replace(lidar=BENCH.lidar.replace(laser=BENCH.lidar.laser.replace(energy_mj=0.2)))
    for name, scenario, number in (("full", BENCH, 0), ("weak", weak, 0), ("later", BENCH, 1)):
        rl.save(folder / f"{name}.h5", rl.simulate(scenario, frames=[number]))
    opened = [rl.open(folder / f"{name}.h5") for name in ("full", "weak", "later")]
    yield opened
    for one in opened:
        one.close()


def test_two_recordings_have_one_scale_whichever_comes_first(recordings):
    full, weak, _ = recordings
    first, second = (draw_recorded_frame(0, *pair, False, LIGHT).images for pair in ((full, weak), (weak, full)))
    assert list(first) == ["A", "B", "B − A"]
    assert (first["A"], first["B"]) == (second["B"], second["A"])
    assert first["A"] == draw_image(full[0], beside=weak[0])
    assert first["B"] == draw_image(weak[0], beside=full[0]) != draw_image(weak[0])


def test_a_frame_that_the_other_has_not_is_drawn_alone(recordings):
    full, _, later = recordings
    drawn = draw_recorded_frame(0, full, later, False, LIGHT)
    assert drawn.images == {"A": draw_image(full[0])}
    assert drawn.lines[1:] == ("later.h5 has no frame 0.",)


def test_the_true_origin_lies_among_the_pixels_of_the_target():
    (frame,) = rl.simulate(rl.Scenario.load("examples/tdrs_approach.toml"), frames=[539])
    centers = locate_centers(frame)
    rows, cols = np.nonzero(frame.labels.target >= 0)
    row, col = centers["truth of tdrs"]
    assert rows.min() <= row <= rows.max()
    assert cols.min() <= col <= cols.max()
    assert "centroid of the points" in centers
