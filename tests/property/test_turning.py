"""Turning everything turns nothing that the lidar sees; what it says of the world turns along."""

import datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from tests.optics.bench_for_tests import box, plate, sphere, write_stl

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1).map(Rotation.from_quat)
shifts = st.tuples(*[st.floats(-1e4, 1e4)] * 3).map(np.array)


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    write_stl(folder / "ball.stl", sphere(3.0, 3))
    write_stl(folder / "sat.stl", np.concatenate([box(2.0, 2.0, 3.0), plate(12.0, 2.0, n=2) + np.array([0, 0, 0.4])]))
    return folder


def quaternion(rotation):
    return tuple(float(x) for x in rotation.as_quat(canonical=True))


def scene(models, turn, shift, seed=3):
    """Return a scenario whose bodies are turned about the root's origin and shifted by the same [m]."""

    def at(*position_m):
        return rl.Fixed(position_m=tuple(float(x) for x in turn.apply(position_m) + shift))

    def held(*rotvec):
        return rl.FixedAttitude(quaternion_xyzw=quaternion(turn * Rotation.from_rotvec(rotvec)))

    settings = {"center_of_mass_m": (0.0, 0.0, 0.0), "material": rl.Phong(diffuse=0.2, specular=0.3, exponent=20.0)}
    return rl.Scenario(
        version=1,
        name="turning",
        seed=seed,
        world=rl.World(axes="local"),
        time=rl.Time(start_utc=START, duration_s=1.0, frame_rate_hz=1.0),
        target=(
            rl.Target(
                name="sat", model=str(models / "sat.stl"), motion=at(400, 3, 1), attitude=held(0.4, 0.2, -1), **settings
            ),
            rl.Target(
                name="ball",
                model=str(models / "ball.stl"),
                motion=at(430, -2, -1.5),
                attitude=held(1, 0, 0),
                **settings,
            ),
        ),
        follower=rl.Follower(motion=at(0, 0, 0), attitude=held(0.003, -0.002, 0.001)),
        ptu=rl.Ptu(point=rl.TrackPoint(at="sat"), response=rl.Ideal()),
        lidar=rl.Lidar(
            receiver=rl.Receiver(fov_deg=3.0, f_number=2.8, n_rows=24, n_cols=24, rays_per_pixel=4),
            laser=rl.Laser(divergence_deg=3.0),
        ),
    )


def fly(scenario):
    return next(iter(rl.simulate(scenario)))


@settings(max_examples=15)
@given(quaternions, shifts)
def test_turning_and_shifting_everything_changes_nothing_in_the_frame(models, turn, shift):
    """Positions in the root lose 2e-12 m to rounding at 1e4 m: 5e-15 rad over 400 m, and a ray at an edge may flip."""
    here, there = fly(scene(models, Rotation.identity(), np.zeros(3))), fly(scene(models, turn, shift))
    a, b = here.labels, there.labels
    assert np.sum(a.target >= 0) > 30
    same = (a.target == b.target) & (a.facet == b.facet)
    # One ray in 1e5 passes an edge closer than float32 tells apart: at most two pixels of 576 may differ at all.
    assert np.sum(~same) <= 2
    seen = same & (a.target >= 0) & (np.abs(a.filled_fraction - b.filled_fraction) < 1e-6)
    assert np.sum(seen) >= np.sum(a.target >= 0) - 2
    for name, tolerance in (("range_m", 1e-8), ("first_range_m", 1e-8), ("cos_incidence", 1e-6)):
        assert np.abs(getattr(a, name) - getattr(b, name))[seen].max() < tolerance
    assert np.allclose(a.photons[seen], b.photons[seen], rtol=1e-5, atol=0)
    # Same seed, same number of clusters: the noise is the same, so the reading is.
    if np.array_equal(a.cluster_count, b.cluster_count):
        assert np.array_equal(here.valid[seen], there.valid[seen])
        both = seen & here.valid & there.valid
        assert np.abs(here.range_m - there.range_m)[both].max() < 1e-3  # float32 at 400 m is 3e-5 m coarse
        counts = here.intensity_counts.astype(int) - there.intensity_counts.astype(int)
        assert np.abs(counts)[both].max() <= 1


@settings(max_examples=10)
@given(quaternions, shifts)
def test_what_the_truth_says_of_the_world_turns_along(models, turn, shift):
    here, there = fly(scene(models, Rotation.identity(), np.zeros(3))).truth, fly(scene(models, turn, shift)).truth
    for name in ("sat", "ball", "follower"):
        expected = turn.as_matrix() @ here.states[name].position_m + shift
        assert np.allclose(there.states[name].position_m, expected, rtol=0, atol=1e-8)
        relative = here.pose("lidar", name).as_matrix() - there.pose("lidar", name).as_matrix()
        assert np.abs(relative).max() < 1e-8
        turned = turn * here.pose("inertial", name).rotation
        assert (turned.inv() * there.pose("inertial", name).rotation).magnitude() < 1e-9


@pytest.mark.parametrize("quarter", [1, 2, 3])
def test_rolling_the_lidar_by_quarter_turns_rolls_the_picture(models, quarter):
    """A mount turned about the boresight: the picture turns the other way, but for sampling, whose lines go along rows."""
    upright, error = scene(models, Rotation.identity(), np.zeros(3)), 0.005
    receiver = upright.lidar.receiver.replace(rays_per_pixel=None, sampling_error=error)
    upright = upright.replace(lidar=upright.lidar.replace(receiver=receiver))
    rolled = upright.replace(lidar=upright.lidar.replace(mount=rl.Mount(euler_zyx_deg=(0.0, 0.0, 90.0 * quarter))))
    a, b = fly(upright).labels, fly(rolled).labels
    # The mount turns from its +y to its +z about +x, the boresight: seen by the lidar clockwise, so the scene turns
    # counter-clockwise, which is numpy's rot90.
    turned = np.rot90(a.photons, quarter)
    assert np.allclose(b.photons, turned, rtol=0.0, atol=2 * error * a.photons.max())
    weight = np.maximum(turned, 1e-3 * turned.max())
    assert np.sum((b.photons - turned) ** 2 / weight) < 2 * (1.5 * error) ** 2 * turned.sum()
    assert np.mean(b.target == np.rot90(a.target, quarter)) > 0.995


def test_a_mirror_is_no_turn(models):
    """The scene has a hand: mirrored left to right it is another one, or the two tests above could not fail."""
    photons = fly(scene(models, Rotation.identity(), np.zeros(3))).labels.photons
    assert not np.allclose(photons, photons[:, ::-1], rtol=0.1, atol=0.01 * photons.max())
    assert not np.allclose(photons, np.rot90(photons), rtol=0.1, atol=0.01 * photons.max())
