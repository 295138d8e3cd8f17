"""Ground as a target: what a scenario says of it, and rays that meet it."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.scenario import CratersAndBoulders
from rso_lidar.scenario.tables.terrain import build_terrain_mesh

MADE = {"type": "craters_and_boulders", "seed": 3, "size_m": 32.0, "cell_m": 0.5, "rock_fraction": 0.2}


def scenario(position_m=(0.0, 0.0, 50.0), pitch_deg=90.0, fov_deg=30.0, **target):
    """Return a scenario of ground and a lidar above it; a pitch of 90 degrees looks straight down."""
    return rl.Scenario(
        version=1,
        name="Ground",
        world=rl.World(axes="local"),
        time=rl.Time(start_utc=datetime.datetime(2024, 9, 17, tzinfo=datetime.UTC), duration_s=1, frame_rate_hz=1),
        target=[rl.Target(name="site", motion=rl.Fixed(position_m=[0, 0, 0]), **target)],
        follower=rl.Follower(
            motion=rl.Fixed(position_m=position_m), attitude=rl.FixedAttitude(euler_zyx_deg=[0, pitch_deg, 0])
        ),
        lidar=rl.Lidar(
            laser=rl.Laser(divergence_deg=fov_deg),
            receiver=rl.Receiver(fov_deg=fov_deg, f_number=1.4, n_rows=32, n_cols=32, rays_per_pixel=4),
        ),
    )


def exact_ranges(surface, origin, directions):
    """Return the range [m] along each ray to the first triangle, in float64 (Moeller and Trumbore 1997); inf: none."""
    a, b, c = (surface.corners[:, k] for k in range(3))
    first, second, away = b - a, c - a, origin - a
    q = np.cross(away, first)
    nearest = np.full(len(directions), np.inf)
    for k, direction in enumerate(directions):
        p = np.cross(direction, second)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / (first * p).sum(axis=1)
            u, v = (away * p).sum(axis=1) * inverse, (q @ direction) * inverse
            t = (second * q).sum(axis=1) * inverse
        met = t[(u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)]
        nearest[k] = met.min(initial=np.inf)
    return nearest


@pytest.mark.parametrize(
    ("cell_m", "relief_m", "height_m", "pitch_deg"),
    [(2.0, 5.0, 1000.0, 90.0), (2.0, 5.0, 30.0, 90.0), (2.0, 5.0, 40.0, 35.0), (40.0, 300.0, 2500.0, 50.0)],
    ids=["from 1 km", "from 30 m", "aslant", "mountains"],
)
def test_ranges_are_those_of_exact_geometry(tmp_path, cell_m, relief_m, height_m, pitch_deg):
    # Rays begin in or at the sphere about a field of 0.2 and 4 km, in float32; the facet's plane is met in float64. Below
    # 1 mm, against 5 cm of the sensor, on all rays but one in a thousand that float32 sends past a crest.
    rng = np.random.default_rng(5)
    at = np.arange(101) * 0.35
    heights = relief_m * (np.sin(at)[:, None] * np.cos(1.3 * at) + 0.2 * rng.normal(size=(101, 101)))
    np.save(tmp_path / "dem.npy", heights)
    terrain = {"type": "height_field", "file": str(tmp_path / "dem.npy"), "cell_m": cell_m}
    said = scenario((0.3, -0.7, height_m), pitch_deg, 12.0, terrain=terrain)
    frame = next(rl.simulate(said, keep=("hits",)))
    hits = frame.kept["hits"]
    some = rng.choice(len(hits.ray), 400, replace=False)
    origin, turn = frame.truth.poses.place("site", "lidar")
    directions = np.einsum("ij,rj->ri", turn, hits.rays.direction[hits.ray[some]])
    apart = np.abs(hits.range_m[some] - exact_ranges(said.surfaces[0], origin, directions))
    assert np.median(apart) < 1e-9
    assert np.sum(apart > 1e-3) == 0


def test_ground_that_is_made_flies_and_says_where_it_comes_from():
    said = scenario(terrain=MADE, material="regolith_highland")
    frame = next(rl.simulate(said))
    entry = frame.source.targets[0]
    assert entry.model == "craters_and_boulders 3"
    assert entry.parts == ("ground", "boulders")
    assert entry.taxonomy.object_class == "terrain"
    seen = frame.labels.target >= 0
    assert seen.all()
    assert set(np.unique(frame.labels.part)) == {0, 1}
    # The ground is some metres deep about 50 m below; a corner of the field of 30 degrees is 1.069 times as far.
    assert frame.labels.range_m.min() > 45.0
    assert frame.labels.range_m.max() < 1.07 * 54.0
    again = rl.Scenario.loads(said.dumps())
    assert again == said
    assert again.surfaces[0].mesh.sha256 == said.surfaces[0].mesh.sha256


def test_a_file_of_heights_is_found_beside_the_scenario(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save(tmp_path / "dem.npy", np.zeros((9, 9)))
    said = scenario(terrain={"type": "height_field", "file": "dem.npy", "cell_m": 8.0})
    (tmp_path / "scenario.toml").write_text(said.dumps())
    monkeypatch.chdir(tmp_path.parent)
    frame = next(rl.simulate(rl.Scenario.load(tmp_path / "scenario.toml")))
    # The mean range over a pixel, whose tangent w is 0.0167, is up to 50 m w²/12 = 1.17 mm beyond that along its middle.
    assert np.allclose(frame.labels.range_m * frame.line_of_sight[..., 2], 50.0, rtol=0.0, atol=1.2e-3)
    assert frame.source.targets[0].model == "dem.npy"


def test_the_whole_field_sees_ground_that_reaches_behind_the_lens():
    # 10 m above a field of 600 m, 25 degrees down: half of it lies behind, and the horizon is at 300 m.
    said = scenario((0.0, 0.0, 10.0), 25.0, terrain={**MADE, "size_m": 600.0, "cell_m": 6.0, "rock_fraction": 0.0})
    frame = next(rl.simulate(said))
    assert (frame.labels.target[4:] == 0).all()
    assert frame.labels.range_m[-1].max() < frame.labels.range_m[4].min()


@pytest.mark.parametrize(
    ("target", "told"),
    [
        ({}, "give model, or terrain"),
        ({"model": "tdrs", "terrain": MADE}, "not both"),
        ({"terrain": MADE, "size_m": 3.0}, "terrain says its size itself"),
        ({"terrain": {**MADE, "cell_m": 0.001}}, r"32000 cells|3\.2e\+04 cells"),
        ({"terrain": {**MADE, "crater_min_m": 40.0}}, "crater_min_m 40 is not below crater_max_m 8"),
        ({"terrain": {**MADE, "boulder_min_m": 9.0}}, "boulder_min_m 9 is not below boulder_max_m 5"),
        ({"terrain": {"type": "geotiff"}}, "height_field"),
    ],
)
def test_bad_ground_is_one_line(target, told):
    with pytest.raises(rl.ScenarioError, match=told) as error:
        scenario(**target)
    assert "\n" not in str(error.value)


def test_ground_is_made_once():
    part = CratersAndBoulders(**MADE)
    assert build_terrain_mesh(part, str) is build_terrain_mesh(CratersAndBoulders(**MADE), str)


def test_a_description_names_the_ground():
    assert "model craters_and_boulders 3, 32." in scenario(terrain=MADE).describe()


def test_ground_is_no_part_that_two_returns_are_too_near_or_too_far_for():
    """It fills the field at every depth, so that a gate that lists two returns has nothing to warn of."""
    two = {"type": "gsfl", "max_returns": 2, "gate": {"delay_ns": 300.0, "width_ns": 200.0}}
    said = scenario(terrain=MADE, material="regolith_highland")
    gated = said.replace(lidar=said.lidar.replace(detector=two))
    assert not [line for line in gated.advice() if "two returns" in line]
