"""Light of a laser beside the lens on a cell of crinkled foil, from vectors of which no two are alike."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rso_lidar.scene.casting import cast
from rso_lidar.scene.materials.crinkle import masking_shadowing

RHO_PER_SR = 0.4 / math.pi


def unit(zenith_deg, azimuth_deg):
    zenith, azimuth = math.radians(zenith_deg), math.radians(azimuth_deg)
    return np.array([math.sin(zenith) * math.cos(azimuth), math.sin(zenith) * math.sin(azimuth), math.cos(zenith)])


def test_a_cell_lit_from_beside_the_lens_counts_by_its_areas_and_what_its_neighbours_leave(monkeypatch):
    """cos θᵢ' cos θₒ' / (cos θᵢ cos θₒ cos τ) and the shared mask of two directions 80 degrees apart in azimuth."""
    monkeypatch.setattr(cast, "find_shadowed", lambda hits, *_: np.zeros(len(hits.facet), bool))
    up, cell, light, viewer = np.array([0.0, 0.0, 1.0]), unit(20.0, 65.0), unit(50.0, 100.0), unit(65.0, 20.0)
    area = (cell @ viewer) / (viewer[2] * math.cos(math.radians(20.0)))
    point = np.array([0.3, -0.2, 0.0])
    hits = SimpleNamespace(
        target_from_lidar=(point + 7.0 * viewer, np.eye(3)),
        point=point[:, None],
        to_viewer=viewer[:, None],
        facing=up[:, None],
        base=up[:, None],
        base_cos_out=viewer[2:],
        normal=cell[:, None],
        cos_out=np.array([cell @ viewer]),
        slope=np.array([0.35]),
        crinkled=np.array([0]),
        projected_area=np.array([area]),
        facet=np.zeros(1, int),
        surface=SimpleNamespace(is_retro=np.array([False]), brdf_per_sr=lambda facet, *_: np.full(1, RHO_PER_SR)),
    )
    laser_from_m = 4.0 * light - 7.0 * viewer
    cos_in, brdf = cast._compute_laser_light(hits, laser_from_m)
    seen = area * (cell @ light) / light[2] * masking_shadowing(light[2], viewer[2], light @ viewer, 0.35)
    assert cos_in == pytest.approx([light[2]], rel=1e-12)
    assert brdf == pytest.approx([RHO_PER_SR * seen], rel=1e-12)
