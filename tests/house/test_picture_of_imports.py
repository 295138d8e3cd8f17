"""The picture of the architecture shows the imports of today, in both of its versions."""

import runpy
from collections import Counter
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def drawing():
    """Return what the script that draws the picture defines; nothing is drawn."""
    return runpy.run_path(str(ROOT / "docs" / "draw_architecture.py"), run_name="drawing")


@pytest.fixture(scope="module")
def graph(drawing):
    return drawing["describe_graph"]()


def test_pictures_are_drawn_from_the_imports_of_today(drawing, graph):
    assert set(drawing["PICTURES"]) == {"architecture", "architecture_dark"}
    for name in drawing["PICTURES"]:
        with Image.open(ROOT / "docs" / "pictures" / f"{name}.png") as picture:
            stated = picture.text["Description"]
        assert stated == drawing["digest_graph"](graph), f"{name}.png is stale: run python docs/draw_architecture.py"


def test_all_rooms_are_in_the_picture_and_arrows_go_down(graph):
    names = [name for floor in (*graph["floors"], *graph["slab"]) for name in floor]
    here = {
        place.stem
        for place in (ROOT / "rso_lidar").iterdir()
        if place.stem[0] not in "_." and place.suffix in ("", ".py")
    }
    assert sorted(names) == sorted(here - {"py"})
    floor_of = {room: k for k, floor in enumerate(graph["floors"]) for room in floor}
    assert len(graph["arrows"]) > 15
    assert all(floor_of[a] < floor_of[b] for a, b, _ in graph["arrows"])


def test_an_arrow_is_left_out_where_others_lead_there(drawing):
    imports = Counter({("a", "b"): 4, ("b", "c"): 5, ("a", "c"): 30, ("c", "d"): 20, ("a", "x"): 9})
    assert drawing["find_arrows"](imports, set("abcd")) == {("a", "b"): 1, ("b", "c"): 2, ("c", "d"): 3}


def test_the_picture_is_the_same_each_time(drawing, graph, tmp_path):
    for name in ("one.png", "two.png"):
        drawing["draw"](graph, tmp_path / name, drawing["PICTURES"]["architecture"])
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    less = {**graph, "arrows": graph["arrows"][1:]}
    assert drawing["digest_graph"](less) != drawing["digest_graph"](graph)


def test_a_room_without_a_place_is_named(drawing, graph):
    with pytest.raises(SystemExit, match="attic"):
        drawing["place_rooms"]([*graph["floors"], ["attic"]])
