"""Loads of sunlight and air on facets, against closed forms."""

import itertools
import math

import numpy as np
import pytest
from scipy.special import erf

from rso_lidar.scene import FacetLoads, GasLaw, measure_error, tabulate_loads
from rso_lidar.scene.surface_forces.exposure import spread_points
from tests.optics.bench_for_tests import box, sphere, surface

WITHIN = 5e-3  # the goal: half a percent
S, WALL, ACCOMMODATION = 7.5, 0.3, 0.93
GAS = GasLaw(S, WALL, ACCOMMODATION)
SPECULAR, DIFFUSE = 0.2, 0.3
REBOUND = math.sqrt(0.5 * (1 + ACCOMMODATION * (2 * WALL / S**2 - 1)))  # Koppenwallner 2009
# GPS Block IIA: faces of 1.553 m2 (x) and 2.881 m2 (z), y their mean, reflectivity 0.56 and specularity 0.20. Fliegel,
# Gallini & Swift 1992, J. Geophys. Res. 97(B1), 559, as src/fortran/PROPBOXW.f90 of Geoscience Australia's Ginan has them.
GPS_IIA_M = 2.028, 1.4206, 1.0932
GPS_IIA_SPECULAR, GPS_IIA_DIFFUSE = 0.2 * 0.56, 0.8 * 0.56


def loads(triangles, points=4096, specular=SPECULAR, diffuse=DIFFUSE, gas=GAS):
    return FacetLoads((surface("t", triangles),), np.array([specular]), np.array([diffuse]), gas, points=points)


def rectangle(a, b, c):
    """Two triangles of a parallelogram with a corner at a and sides b and c."""
    a, b, c = (np.array(x, dtype=float) for x in (a, b, c))
    return np.array([[a, a + b, a + b + c], [a, a + b + c, a + c]])


def unit(*vector):
    return np.array(vector, dtype=float) / np.linalg.norm(vector)


def light_on_plate(area, way, normal):
    """Montenbruck & Gill eq. 3.73."""
    c = way @ normal
    return -area * c * ((1 - SPECULAR) * way + 2 * (SPECULAR * c + DIFFUSE / 3) * normal)


def air_on_side(area, way, normal):
    """Sentman's drag and lift of one side of a plate."""
    g = way @ normal
    lift_axis = normal - g * way
    lift = np.linalg.norm(lift_axis)
    p, z = math.exp(-((g * S) ** 2)) / S, 1 + erf(g * S)
    thrown = REBOUND * (g * math.sqrt(math.pi) * z + p)
    drag = p / math.sqrt(math.pi) + g * (1 + 1 / (2 * S * S)) * z + g / 2 * thrown
    across = lift / (2 * S * S) * z + lift / 2 * thrown
    return -area * (drag * way + (across * lift_axis / lift if lift > 1e-12 else 0.0))


def test_a_sphere_is_that_of_the_closed_forms():
    """C_R = 1 + 4/9 of the diffuse share; Sentman's sphere. The mesh is smaller than the sphere by 0.13 %."""
    light, _, air, torque = loads(sphere(1.0, 4), 6000).compute(unit(1, 2, 3))
    s = S
    drag = (2 * s**2 + 1) / (math.sqrt(math.pi) * s**3) * math.exp(-s * s)
    drag += (4 * s**4 + 4 * s**2 - 1) / (2 * s**4) * erf(s) + 2 * math.sqrt(math.pi) / 3 * REBOUND
    assert light == pytest.approx(-math.pi * (1 + 4 / 9 * DIFFUSE) * unit(1, 2, 3), rel=WITHIN, abs=0.01)
    assert air == pytest.approx(-math.pi * drag * unit(1, 2, 3), rel=WITHIN, abs=0.02)
    assert np.abs(torque).max() < 0.02


@pytest.mark.parametrize("way", [unit(1, 0, 0), unit(1, 2, 3), unit(-3, 1, 0.2)])
def test_a_box_is_the_sum_of_its_sides(way):
    light, light_torque, air, _ = loads(box(1.0, 2.0, 3.0)).compute(way)
    expected, gas = np.zeros(3), np.zeros(3)
    for axis, area in enumerate((6.0, 3.0, 2.0)):
        for sign in (-1.0, 1.0):
            normal = sign * np.eye(3)[axis]
            gas += air_on_side(area, way, normal)
            if way @ normal > 0:
                expected += light_on_plate(area, way, normal)
    assert light == pytest.approx(expected, abs=WITHIN * np.linalg.norm(expected))
    assert air == pytest.approx(gas, abs=WITHIN * np.linalg.norm(gas))
    assert np.abs(light_torque).max() < WITHIN * np.linalg.norm(expected)


def test_a_cylinder_along_the_flow_is_dragged_by_its_wall_too():
    """Front by Sentman at normal incidence, wall at grazing incidence, for a cylinder of 96 sides."""
    turn = 2 * np.pi * np.arange(97) / 96
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    facets = []
    for a, b in itertools.pairwise(rim):
        low, high = np.array([*a, -3.0]), np.array([*a, 3.0])
        low2, high2 = np.array([*b, -3.0]), np.array([*b, 3.0])
        facets += [[low, low2, high2], [low, high2, high], [[0, 0, 3.0], high, high2], [[0, 0, -3.0], low2, low]]
    cap, wall = 48 * math.sin(2 * np.pi / 96), 96 * 2 * math.sin(np.pi / 96) * 6.0
    _, _, air, _ = loads(np.array(facets, dtype=float)).compute(unit(0, 0, 1))
    expected = -air_on_side(cap, unit(0, 0, 1), unit(0, 0, 1))[2] + wall / (S * math.sqrt(math.pi))
    assert -air[2] == pytest.approx(expected, rel=WITHIN)


def test_a_wall_shades_the_floor_of_an_l():
    """A floor of 1 m x 2 m and a wall of height 1 at its far end, lit from behind the wall at 45 degrees."""
    shape = np.concatenate([rectangle((0, 0, 0), (2, 0, 0), (0, 1, 0)), rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1))])
    way = unit(-1, 0, 1)
    light, torque, _, _ = loads(shape).compute(way)
    floor, wall = light_on_plate(1.0, way, unit(0, 0, 1)), light_on_plate(1.0, way, unit(-1, 0, 0))
    assert light == pytest.approx(floor + wall, abs=WITHIN * np.linalg.norm(floor + wall))
    expected = np.cross([1.5, 0.5, 0.0], floor) + np.cross([0.0, 0.5, 0.5], wall)
    assert torque == pytest.approx(expected, abs=2 * WITHIN * np.linalg.norm(expected))


def test_a_plate_off_the_centre_of_mass_is_turned_by_its_arm():
    plate = rectangle((2.0, -0.5, 0.3), (1, 0, 0), (0, 1, 0))
    way = unit(0.3, -0.4, 1)
    light, torque, air, air_torque = loads(plate).compute(way)
    middle = np.array([2.5, 0.0, 0.3])
    assert light == pytest.approx(light_on_plate(1.0, way, unit(0, 0, 1)), rel=1e-9)
    assert torque == pytest.approx(np.cross(middle, light), rel=1e-9)
    assert air_torque == pytest.approx(np.cross(middle, air), rel=1e-6)


@pytest.mark.parametrize(
    ("way", "light", "air"),
    [
        (unit(1, 0, 0), (-2.190765, 0, 0), (-4.450852, 0, 0)),
        (unit(1, 2, 3), (-1.076768, -2.351735, -3.888627), (-2.264641, -4.639487, -7.13995)),
        (unit(-3, 1, 0.2), (2.728345, -0.917554, -0.188706), (5.156895, -1.823393, -0.397097)),
    ],
)
def test_the_body_of_a_gps_satellite_is_pushed_as_another_program_computes(way, light, air):
    """ADBSat-PyVersion a579a036 (github.com/jovbos2208): its coeff_sentman and coeff_solar, summed over the facets.

    Its numbers have 6 decimals. Molecules that barely reach a side that is turned from the flow are left out here.
    """
    loads_m2, _, air_m2, _ = loads(box(*GPS_IIA_M), 4096, GPS_IIA_SPECULAR, GPS_IIA_DIFFUSE).compute(way)
    assert loads_m2 == pytest.approx(light, abs=1e-6)
    assert air_m2 == pytest.approx(air, abs=1e-4 * np.linalg.norm(air))


def test_every_point_lies_within_its_facet():
    points = spread_points(surface("t", box(2.0, 1.4, 1.1)), 4096)
    assert (np.abs(points.position) <= np.array([1.0, 0.7, 0.55])[:, None] * (1 + 1e-12)).all()
    assert points.position @ points.area == pytest.approx(np.zeros(3), abs=1e-12)


def test_copies_of_a_facet_do_not_count_twice():
    plate = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    once, twice = loads(plate).compute(unit(0, 0, 1)), loads(np.concatenate([plate, plate])).compute(unit(0, 0, 1))
    assert twice == pytest.approx(once, abs=1e-12)


def test_a_box_with_wings_is_tabulated_within_two_percent_everywhere():
    """GPS Block IIA: its body, and two wings of 10.886 m2 in all."""
    wings = [rectangle((-0.5, side, -1.48), (0, 0, 2.96), (0, 1.8389 * np.sign(side), 0)) for side in (1.0, -1.0)]
    craft = loads(np.concatenate([box(*GPS_IIA_M), *wings]), 1024)
    table = tabulate_loads(craft, 7.5)
    light, air = measure_error(craft, table, 100)
    assert light < 0.02
    assert air < 0.02
