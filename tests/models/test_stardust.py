"""Stardust has the dimensions that were published of it, and its capsule stands open."""

import math

import numpy as np
import pytest

from models.build import stardust_capsule as capsule
from models.build.stardust import SHEET_STEP_M, stardust


@pytest.fixture(scope="module")
def craft():
    return stardust()


def test_bus_and_antenna_are_as_published(craft):
    # NASA press kit: 1.7 m x 0.66 m x 0.66 m; edges carry the size, brackets for the wings stand out sideways
    bus = craft.parts["bus"].vertices
    assert np.ptp(bus[:, [0, 2]], axis=0) == pytest.approx([1.70, 0.66], abs=0.001)
    floor = bus[bus[:, 2] < 0.0]
    assert np.ptp(floor[:, 1]) == pytest.approx(0.66, abs=0.001)
    assert np.ptp(craft.parts["antenna_high_gain"].vertices[:, 0]) == pytest.approx(0.6, abs=0.005)


def test_panels_have_room_for_the_quoted_cells(craft):
    # 6.6 m2 of solar array are quoted; cells cover that much and the boards hold them with a margin
    cells_m2 = 0.0
    for side in ("left", "right"):
        solid = craft.parts[f"solar_array_{side}"]
        a, b, c = (solid.vertices[solid.facets[:, k]] for k in range(3))
        upward = np.cross(b - a, c - a)[:, 2]
        cells_m2 += 0.5 * upward[upward > 0.0].sum()
    assert 6.6 < cells_m2 < 1.2 * 6.6


def test_capsule_is_as_large_as_published(craft):
    # University of Washington: about 30 in across (0.81 m is quoted elsewhere) and 20 in deep
    cover, shield = capsule.cover().vertices, capsule.heat_shield().vertices
    assert np.ptp(cover[:, 1]) == pytest.approx(0.81, abs=0.005)
    assert np.ptp(shield[:, 1]) == pytest.approx(0.81, abs=0.005)
    shut = _shut().vertices
    nose, rim = shut[:, 0].min(), cover[:, 0].min()
    # the cover's seal stands out by 8 mm, the shield's lip by 45 mm lies over it
    assert cover[:, 0].max() - nose - (capsule.LIP_M - 0.003) == pytest.approx(20 * 0.0254, abs=0.01)
    assert nose < rim < shut[:, 0].max()


def _shut():
    """Return the heat shield swung up, without its arms."""
    x, _, z = capsule.HINGE_M
    return capsule.heat_shield().move(-x, 0.0, -z).turn("y", capsule.OPEN_DEG).move(x, 0.0, z)


def test_heat_shield_closes_the_capsule_about_its_hinge(craft):
    """Swung to the end of its travel the heat shield stands before the open cover, on one axis with it."""
    hinge = next(hinge for hinge in craft.hinges if hinge.name == "heat_shield")
    assert (hinge.position_m, hinge.travel_deg[1]) == (tuple(capsule.HINGE_M), capsule.OPEN_DEG)
    shut, cover = _shut().vertices, capsule.cover().vertices
    for axis in (1, 2):
        assert [shut[:, axis].min(), shut[:, axis].max()] == pytest.approx(
            [cover[:, axis].min(), cover[:, axis].max()], abs=0.005
        )
    assert shut[:, 0].min() < cover[:, 0].min() - 0.15, "its nose points away from the bus"


def test_collector_holds_the_quoted_aerogel():
    # 132 cells and 1039 cm2 are quoted; rows laid to fit a circle need not come out even
    cells = len(capsule.aerogel().facets) // 12
    assert cells == pytest.approx(132, rel=0.05)
    assert cells * math.prod(capsule.CELL_M) == pytest.approx(0.1039, rel=0.1)


def test_sheets_of_the_wing_shields_stand_two_inches_apart(craft):
    # JPL, 'Cool Facts'
    x = np.unique(np.round(craft.parts["shield_left"].vertices[:, 0], 6))
    assert math.isclose(SHEET_STEP_M, 2 * 0.0254)
    assert np.isclose(x, x.max() - SHEET_STEP_M, atol=1e-5).any()


def test_masses_are_those_of_the_spacecraft_and_the_capsule(craft):
    # JPL missions page: 254 kg of spacecraft and 46 kg of return capsule, without fuel
    inside = ("capsule", "heat_shield", "collector", "aerogel", "collector_arm")
    assert sum(craft.pieces[name].mass_kg for name in inside) == pytest.approx(46.0, rel=0.01)
    assert craft.mass_kg == pytest.approx(300.0)
