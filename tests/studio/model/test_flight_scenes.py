"""Views in space agree with the truth."""

import json
import struct

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.scene import load_materials
from rso_lidar.studio.model.flight import PreviewFlight
from rso_lidar.studio.model.flight_scenes import VIEWS
from rso_lidar.studio.model.space_scene import SpaceScene


@pytest.fixture(scope="module")
def flight() -> PreviewFlight:
    return PreviewFlight(rl.Scenario.load("examples/tdrs_approach.toml"))


def read(scene: SpaceScene) -> tuple[dict, list[np.ndarray]]:
    packed = scene.pack()
    (length,) = struct.unpack("<I", packed[:4])
    header, offset, found = json.loads(packed[4 : 4 + length]), 4 + length, []
    for item in header["items"]:
        if "count" in item:
            found.append(np.frombuffer(packed, "<f4", 3 * item["count"], offset).reshape(-1, 3))
            offset += 12 * item["count"] + (-(-3 * item["count"] // 4) * 4 if item.get("coloured") else 0)
    assert offset == len(packed)
    return header, found


def _drawn(header: dict) -> list[dict]:
    return [item for item in header["items"] if "count" in item]


@pytest.mark.parametrize("name", list(VIEWS))
def test_a_scene_is_packed_whole(flight: PreviewFlight, name: str) -> None:
    header, _ = read(VIEWS[name](flight, 200))
    assert header["name"] == name
    assert np.isfinite(header["camera"]["eye"]).all()


def test_the_sun_of_the_orbit_lights_its_side_of_the_earth(flight: PreviewFlight) -> None:
    header, _ = read(VIEWS["orbit"](flight, 0))
    np.testing.assert_allclose(header["sun"], flight.truth(0).sun_direction)


def test_stars_and_earth_are_where_the_inertial_axes_have_them(flight: PreviewFlight) -> None:
    """Sirius is at 101.287 deg, -16.716 deg (J2000)."""
    header, arrays = read(VIEWS["target"](flight, 200))
    sky = next(array for item, array in zip(_drawn(header), arrays, strict=True) if item["kind"] == "sky")
    ascension, declination = np.radians([101.287, -16.716])
    flat = np.cos(declination)
    sirius = np.array([flat * np.cos(ascension), flat * np.sin(ascension), np.sin(declination)])
    truth = flight.truth(200)
    seen = truth.pose(flight.axes, "inertial").rotation.apply(sirius)
    assert np.degrees(np.linalg.norm(np.cross(sky[0], seen))) < 0.001 and sky[0] @ seen > 0.0
    (earth,) = (item for item in header["items"] if item["kind"] == "earth")
    down = truth.pose("tdrs.rtn", "inertial").translation - truth.pose("tdrs.rtn", "tdrs").translation
    np.testing.assert_allclose(earth["at"], down, rtol=1e-9)
    assert earth["at"][0] < -42e6  # in rtn axes, the Earth lies towards minus radial


def test_a_model_has_the_colours_of_its_materials(flight: PreviewFlight) -> None:
    ((_, packed),) = flight.models.values()
    (surface,) = flight.scenario.surfaces
    count = len(surface.facets)
    assert len(packed) == 39 * count
    rgb = np.frombuffer(packed, np.uint8, 3 * count, 36 * count).reshape(-1, 3)
    order = np.argsort(-surface.areas_m2)
    catalogue = {tuple(np.round(np.multiply(one["display_rgb"], 255)).astype(int)) for one in load_materials().values()}
    assert {tuple(one) for one in rgb.astype(int)} <= catalogue
    arrays = [k for k, name in enumerate(surface.mesh.part_names) if "array" in name or "panel" in name]
    blue = rgb[np.isin(surface.part[order], arrays)].astype(int)
    assert len(blue) and (blue[:, 2] > blue[:, 0]).all()  # solar cells


def test_the_target_is_drawn_where_the_lidar_looks(flight: PreviewFlight) -> None:
    header, _ = read(VIEWS["lidar"](flight, 399))
    matrix = np.array(next(item for item in header["items"] if item["kind"] == "model")["matrix"]).reshape(4, 4).T
    boresight = flight.matrix(399, "lidar")[:3, 2]
    assert np.linalg.norm(matrix[:3, 3]) == pytest.approx(flight.range_m(399))
    assert boresight @ matrix[:3, 3] / flight.range_m(399) == pytest.approx(1.0, abs=1e-5)


def test_the_path_of_the_follower_ends_300_m_behind_the_target(flight: PreviewFlight) -> None:
    assert flight.axes == "tdrs.rtn"
    assert flight.path_m[0] == pytest.approx([0.0, -3000.0, 0.0], abs=1.0)
    assert flight.path_m[-1] == pytest.approx([0.0, -300.0, 0.0], abs=15.0)


@pytest.mark.parametrize("name", ["tdrs_approach", "tle_flyby"])
def test_the_view_of_the_orbit_holds_the_earth_and_all_bodies(name: str) -> None:
    """The field of the view is 40 degrees high and at least as wide."""
    flown = PreviewFlight(rl.Scenario.load(f"examples/{name}.toml"))
    header, arrays = read(VIEWS["orbit"](flown, 0))
    eye = np.array(header["camera"]["eye"])
    ahead = -eye / np.linalg.norm(eye)
    drawn = _drawn(header)
    points = np.concatenate([array for item, array in zip(drawn, arrays, strict=True) if item["kind"] != "sky"])
    (earth,) = (item for item in header["items"] if item["kind"] == "earth")
    sight = points - eye
    cosine = sight @ ahead / np.linalg.norm(sight, axis=1)
    assert np.degrees(np.arccos(cosine.min())) < 20.0
    assert np.degrees(np.arcsin(earth["radius"] / np.linalg.norm(eye))) < 20.0
