"""The card of a model: its light against the link budget, and one line for a model that is none."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.mission_analysis import make_model_card
from rso_lidar.mission_analysis.models.model_card import SIDES


def test_a_plate_sends_back_what_the_budget_says():
    card = make_model_card("plate")
    seen = {(one.wavelength_nm, one.side): one for one in card.returns}
    facing = seen[1064.0, "from +x"]
    # a filled pixel by the closed form, which shares no radiometry with the chain; 0.5 % is what the two agree to
    budget = rl.budget("gsfl_1064", materials=[0.3], range_m=[900.0, 1000.0]).curves[0]
    assert facing.brightest_photons == pytest.approx(budget.photons[-1], rel=5e-3)
    # 16 m2 in pixels of 0.341 m
    assert facing.photons == pytest.approx(budget.photons[-1] * 16.0 / 0.34094**2, rel=5e-3)
    # another wavelength: the same energy is more photons
    assert seen[1570.0, "from +x"].photons == pytest.approx(facing.photons * 1570 / 1064, rel=1e-6)
    assert seen[1064.0, "from +y"].photons < 1e-2 * facing.photons  # 2 mm of edge


def test_a_card_shows_parts_and_materials(tmp_path):
    card = make_model_card("tdrs", returns=False)
    assert [view.side for view in card.views] == list(SIDES)
    for view in card.views:
        assert np.array_equal(view.part >= 0, view.material >= 0)
    assert any("relay satellite" in line for line in card.lines)
    assert any("solar_north" in line for line in card.lines)
    assert card.save(tmp_path / "tdrs.png").stat().st_size > 20_000


def test_light_stands_in_a_table_whose_cells_do_not_meet():
    card = make_model_card("cubesat_3u")
    heads, *rows = card.light_table()
    assert [row[0] for row in rows] == list(SIDES) and all(len(row) == len(heads) == 5 for row in rows)
    figure = card.figure()
    figure.canvas.draw()
    cells = [text for text in figure.texts if text.get_text() in {*heads, *(cell for row in rows for cell in row)}]
    assert len(cells) == 25
    boxes = [text.get_window_extent() for text in figure.texts if text.get_text()]
    assert not [1 for k, box in enumerate(boxes) for other in boxes[k + 1 :] if box.overlaps(other)]
    width, height = figure.canvas.get_width_height()
    assert all(0 <= box.x0 and box.x1 <= width and 0 <= box.y0 and box.y1 <= height for box in boxes)


def test_no_model_is_one_line():
    with pytest.raises(rl.ScenarioError, match="unknown model 'tdr'; did you mean 'tdrs'") as caught:
        make_model_card("tdr")
    assert "\n" not in str(caught.value)
