import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.track import locate_centroid

PIXEL_RAD, RANGE_M, SIDE_M = 1e-3, 300.0, 3.6  # a plate of 12 by 12 pixels


def cloud(rng, found=1.0, noise_m=0.05):
    """Return an organised cloud of a plate that faces the lidar, the pixels' grid put down anywhere, at any turn."""
    turn_rad = rng.uniform(0.0, np.pi)
    at = (np.arange(40) - 20.0 + rng.random()) * PIXEL_RAD, (np.arange(40) - 20.0 + rng.random()) * PIXEL_RAD
    x, y = np.meshgrid(*at)
    line = np.stack([x, y, np.ones_like(x)], axis=-1)
    places = line * RANGE_M
    right = np.cos(turn_rad) * places[..., 0] + np.sin(turn_rad) * places[..., 1]
    down = np.cos(turn_rad) * places[..., 1] - np.sin(turn_rad) * places[..., 0]
    on = (np.abs(right) < SIDE_M / 2) & (np.abs(down) < SIDE_M / 2) & (rng.random(x.shape) < found)
    line /= np.linalg.norm(line, axis=-1, keepdims=True)
    places = places + line * rng.normal(0.0, noise_m, x.shape)[..., None]
    return np.where(on[..., None], places, np.nan)


@pytest.mark.parametrize("found", [1.0, 0.5])
def test_covariance_is_that_of_many_clouds(found):
    rng = np.random.default_rng(1)
    fixes = [locate_centroid(cloud(rng, found), pixel_rad=PIXEL_RAD, range_noise_m=0.05) for _ in range(400)]
    spread = np.var([fix.position_m for fix in fixes], axis=0)
    told = np.mean([np.diag(fix.covariance_m2) for fix in fixes], axis=0)
    # A variance of 400 has 7 % of noise, 3 sigma 21 %. Across, with all pixels there, the truth is 0.3 to 1
    # of the edge's term (its docstring); with half of them it is chance of the pixels that counts.
    assert spread[2] / told[2] == pytest.approx(1.0, abs=0.21)
    across = spread[:2] / told[:2]
    if found == 1.0:
        assert ((across > 0.24) & (across < 1.25)).all()
    else:
        np.testing.assert_allclose(across, 1.0, atol=0.25)
    counted = np.mean([fix.found_fraction for fix in fixes])
    assert counted == pytest.approx(found, abs=0.01)  # 400 clouds of some 70 pixels between two that returned


def test_false_triggers_are_left_out():
    rng = np.random.default_rng(2)
    seen = cloud(rng).reshape(-1, 3)
    seen = seen[np.isfinite(seen[:, 0])]
    line = rng.uniform(-0.02, 0.02, (60, 2))
    false = np.column_stack([line, np.ones(60)]) * rng.uniform(1.0, 5000.0, (60, 1))
    alone = locate_centroid(seen, pixel_rad=PIXEL_RAD, gate_m=5.0)
    mixed = locate_centroid(np.vstack([false, seen, np.full((5, 3), np.nan)]), pixel_rad=PIXEL_RAD, gate_m=5.0)
    np.testing.assert_allclose(mixed.position_m, alone.position_m, rtol=0, atol=1e-9)
    assert alone.found_fraction == 1.0  # a list has no pixels between others
    assert alone.range_m == pytest.approx(RANGE_M, abs=0.1)


def test_nothing_to_see():
    assert locate_centroid(np.full((8, 8, 3), np.nan), pixel_rad=PIXEL_RAD) is None
    assert locate_centroid(np.zeros((0, 3)), pixel_rad=PIXEL_RAD) is None
    assert locate_centroid(np.array([[0.0, 0.0, 100.0]] * 3), pixel_rad=PIXEL_RAD) is None
    assert locate_centroid(np.array([[0.0, 0.0, 100.0]] * 3), pixel_rad=PIXEL_RAD, min_points=3).points_m.shape == (
        3,
        3,
    )


@pytest.mark.parametrize(
    ("points", "given"),
    [
        (np.zeros((4, 2)), {}),
        (np.zeros(3), {}),
        (np.zeros((4, 3)), {"gate_m": 0.0}),
        (np.zeros((4, 3)), {"pixel_rad": 0.0}),
    ],
)
def test_refused(points, given):
    with pytest.raises(rl.ScenarioError, match="centroid"):
        locate_centroid(points, **({"pixel_rad": PIXEL_RAD} | given))
