"""Scattering from any direction into any other: on flat pieces, and on the tilted cells of crinkled foil."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rso_lidar.scene.bounces.scattering import scatter_per_sr
from rso_lidar.scene.materials.crinkle import masking_shadowing

RHO_PER_SR = 0.3 / math.pi


def unit(zenith_deg, azimuth_deg):
    zenith, azimuth = math.radians(zenith_deg), math.radians(azimuth_deg)
    return np.array([math.sin(zenith) * math.cos(azimuth), math.sin(zenith) * math.sin(azimuth), math.cos(zenith)])


def test_a_cell_of_foil_counts_by_its_area_as_light_and_viewer_see_it():
    """cos θᵢ' cos θₒ' / (cos θᵢ cos θₒ cos τ), one piece flat, one with a cell tilted by 25°, one lit from behind."""
    up, tilted = np.array([0.0, 0.0, 1.0]), unit(25.0, 70.0)
    light, viewer, behind = unit(40.0, 100.0), unit(55.0, -20.0), unit(120.0, 10.0)
    slope = np.array([0.0, 0.3, 0.3])
    points = SimpleNamespace(
        facing=np.stack([up] * 3, axis=1),
        base=np.stack([up] * 3, axis=1),
        normal=np.stack([up, tilted, tilted], axis=1),
        slope=slope,
        crinkled=np.flatnonzero(slope),
        facet=np.zeros(3, int),
        surface=SimpleNamespace(brdf_per_sr=lambda facet, *cosines: np.full(len(facet), RHO_PER_SR)),
    )
    got = scatter_per_sr(points, np.stack([light, light, behind], axis=1), np.stack([viewer] * 3, axis=1))
    seen = (tilted @ light) * (tilted @ viewer) / (light[2] * viewer[2] * math.cos(math.radians(25.0)))
    seen *= masking_shadowing(light[2], viewer[2], light @ viewer, 0.3)
    assert got == pytest.approx([RHO_PER_SR, RHO_PER_SR * seen, 0.0], rel=1e-12)
