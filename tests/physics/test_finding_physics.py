"""Whether a whole body is found: the closed form, and how far it is found, against frames of the walk itself.

The frames come from `simulate`, of a scenario that puts the body into each attitude and place by objects of its own. They
share with the closed form the light and the detector's settings, and neither the law of a pixel nor that of a body. The
tolerances are the 0.03 that is asked of a probability, with three standard errors of the frames, and 3 % of a range.
"""

import datetime
import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.mission_analysis import find_range
from rso_lidar.mission_analysis.budgets.attitude_search import face_direction, place_body
from rso_lidar.records import BodyState
from rso_lidar.scenario import Finding, find_aspects, move_target, preview_mission, spread_attitudes

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
LIDAR_FROM_FOLLOWER = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
BESIDE_M = 2.0  # a report within this of the label's range is of the body, which is 0.4 m deep
ATTITUDES, REPEATED = 48, 8
# The middle of the camera of Fuller et al.: as many pixels as a body of this range can meet.
MIDDLE = {"fov_deg": 2.0 * math.degrees(math.atan(math.tan(math.radians(1.25)) / 8.0)), "n_rows": 16, "n_cols": 16}
# Frames and closed form take the same light, so that a grid of a tenth of the rays serves both.
GRID = {"rays_per_pixel": 100}
CAMERA = rl.Lidar(preset="gsfl_1064", receiver=MIDDLE | GRID)


@dataclass(frozen=True)
class Places:
    """A motion that is elsewhere in each frame."""

    position_m: tuple
    orbits = False

    def states(self, epochs):
        there = np.array(self.position_m)[np.rint(epochs.time_s).astype(int) % len(self.position_m)]
        return BodyState(there, np.zeros(there.shape))


@dataclass(frozen=True)
class Attitudes:
    """An attitude that is another in each frame."""

    quaternion_xyzw: tuple

    def orient(self, situation):
        frame = np.rint(situation.epochs.time_s).astype(int) % len(self.quaternion_xyzw)
        return rl.motion.Orientation(
            Rotation.from_quat(np.array(self.quaternion_xyzw)[frame]), np.zeros((len(frame), 3))
        )


def bench(lidar, model="cubesat_3u", frames=1, motion=None, attitude=None):
    return rl.Scenario(
        version=1,
        name="found",
        seed=11,
        world=rl.World(axes="local"),
        time=rl.Time(start_utc=START, duration_s=float(frames), frame_rate_hz=1.0),
        target=(
            rl.Target(
                name="body", model=model, motion=motion or rl.Fixed(position_m=(1000.0, 0.0, 0.0)), attitude=attitude
            ),
        ),
        follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=lidar,
    )


def count_in_frames(lidar, range_m, matrices, phases, repeated):
    """Return how many pixels (attitude, repetition) report the body in frames of the walk."""
    tangents = np.column_stack([phases * lidar.receiver.pixel_tangent, np.ones(len(phases))])
    seen_m = range_m * tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    there = Places(tuple(map(tuple, np.repeat(seen_m @ LIDAR_FROM_FOLLOWER, repeated, axis=0))))
    turned = Rotation.from_matrix(LIDAR_FROM_FOLLOWER.T @ matrices).as_quat()
    scenario = bench(
        lidar,
        frames=len(there.position_m),
        motion=there,
        attitude=Attitudes(tuple(map(tuple, np.repeat(turned, repeated, axis=0)))),
    )
    counts = []
    for frame in rl.simulate(scenario):
        with np.errstate(invalid="ignore"):
            near = np.abs(frame.range_m - frame.labels.range_m) < BESIDE_M
        counts.append(int((near & (frame.labels.target == 0)).sum()))
    return np.array(counts).reshape(-1, repeated)


def solve(lidar, range_m, matrices, phases, finding):
    """Return the probability of each attitude (attitude)."""
    scenario = bench(lidar)
    there = preview_mission(scenario).truth.at(0)
    truths = [
        move_target(scenario, 0, there, place_body(lidar, range_m, phase), matrix)
        for matrix, phase in zip(matrices, phases, strict=True)
    ]
    return find_aspects(lidar, scenario.surfaces, 0, truths, finding)[0]


def standard_error(probability, repeated):
    """Return the standard error of the frequency over attitudes that were repeated."""
    return float(np.sqrt(np.sum(probability * (1.0 - probability)) / repeated)) / len(probability)


@pytest.fixture(scope="module")
def far():
    return find_range(CAMERA, "cubesat_3u", attitudes=ATTITUDES, range_m=(500.0, 2000.0))


@pytest.fixture(scope="module")
def frames(far):
    """Return the counts of pixels in frames, at two ranges about the greatest."""
    ranges_m = far.max_range_m * np.array([0.93, 1.07])
    return {at: count_in_frames(CAMERA, at, *spread_attitudes(ATTITUDES), REPEATED) for at in ranges_m.tolist()}


@pytest.mark.slow
@pytest.mark.parametrize("pixels", [1, 2])
def test_as_many_flashes_find_a_cubesat_as_the_closed_form_says(frames, pixels, validation):
    aspects = spread_attitudes(ATTITUDES)
    for range_m, counts in frames.items():
        each = solve(CAMERA, range_m, *aspects, Finding(pixels=pixels))
        found = float((counts >= pixels).mean())
        within = 0.03 + 3.0 * standard_error(each, REPEATED)
        validation(
            case=f"a 3U CubeSat found by {pixels} pixel{'s' * (pixels > 1)} or more of `gsfl_1064` at {range_m:.0f} m, all "
            "attitudes",
            source=f"{counts.size} simulated frames",
            expected=found,
            got=float(each.mean()),
            tolerance=within,
            unit="1",
        )


def test_k_of_n_flashes_find_a_cubesat_as_often_as_the_closed_form_says(frames, validation):
    """In two of three flashes of one attitude and place: all choices of three of the repeated frames are counted."""
    aspects = spread_attitudes(ATTITUDES)
    range_m, counts = max(frames.items())
    each = solve(CAMERA, range_m, *aspects, Finding(needed=2, flashes=3))
    once = solve(CAMERA, range_m, *aspects, Finding())
    triples = np.array(list(combinations(range(REPEATED), 3)))
    found = float(((counts >= 1)[:, triples].sum(axis=2) >= 2).mean())
    validation(
        case=f"a 3U CubeSat found in 2 of 3 flashes of `gsfl_1064` at {range_m:.0f} m, all attitudes",
        source=f"{counts.size} simulated frames",
        expected=found,
        got=float(each.mean()),
        tolerance=0.03 + 3.0 * standard_error(each, REPEATED / 3),
        unit="1",
    )
    # Attitudes differ more than flashes of one do: k of n of the mean probability would be another number.
    alike = float(once.mean()) ** 2 * (3.0 - 2.0 * float(once.mean()))
    assert abs(alike - each.mean()) > 0.02


def test_the_greatest_range_is_that_of_frames(far, frames, validation):
    """Between the two ranges the probit of the frequency is interpolated along the logarithm of range."""
    from scipy.special import ndtri

    (near_m, near), (far_m, beyond) = sorted(frames.items())
    normal = [float(ndtri((counts >= 1).mean())) for counts in (near, beyond)]
    share = (normal[0] - float(ndtri(0.9))) / (normal[0] - normal[1])
    validation(
        case="range at which a 3U CubeSat is found with 90 % by `gsfl_1064`, all attitudes (`rso-lidar budget --find`)",
        source=f"{near.size + beyond.size} simulated frames",
        expected=near_m * (far_m / near_m) ** share,
        got=far.max_range_m,
        tolerance=0.03 * far.max_range_m,
        unit="m",
    )
    assert far.is_by_pixel
    assert far.range_of(0.9) == pytest.approx(far.max_range_m, rel=0.01)


def test_the_worst_attitude_is_worse_than_nearly_all_others(far):
    matrices, _ = spread_attitudes(48)
    places = np.repeat(spread_attitudes(6)[1], 48, axis=0)
    each = solve(CAMERA, far.max_range_m, np.tile(matrices, (6, 1, 1)), places, Finding()).reshape(6, 48).mean(axis=0)
    assert far.worst_there < np.quantile(each, 0.05) + 0.05
    assert far.worst_there < far.probability < each.mean() + 0.05
    assert far.worst_range_m < far.max_range_m
    np.testing.assert_allclose(Rotation.from_quat(far.worst_quaternion_xyzw).as_matrix(), far.worst_attitude, atol=1e-9)


COUPLED = {"speckle": {"depolarising": False}, "crosstalk": {}, "droop": {"capacitance_nf": 0.004}}
GATE = {"gate": {"delay_ns": 6605.0, "width_ns": 120.0}}  # 990 to 1008 m
JITTERY = CAMERA.laser.replace(energy_jitter_fraction=0.3)
CASES = {
    "energy jitter of 30 %": (CAMERA.replace(laser=JITTERY), 870.0),
    "a gate": (CAMERA.replace(detector=rl.Gsfl(**GATE)), 1000.0),
    "a Geiger-mode array of 20 pulses": (
        rl.Lidar(
            preset="geiger_1064", receiver=GRID, detector={"pulses": 20, "gate_from_m": 250.0, "gate_to_m": 350.0}
        ),
        300.0,
    ),
    "the empirical detector": (CAMERA.replace(detector=rl.Empirical()), 870.0),
    "speckle, crosstalk and droop": (CAMERA.replace(detector=rl.Gsfl(**COUPLED)), 870.0),
}
QUICK = {"energy jitter of 30 %", "the empirical detector"}


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if case in QUICK else pytest.mark.slow) for case in CASES]
)
def test_other_detectors_find_a_cubesat_as_often_as_their_frames_do(case, validation):
    lidar, range_m = CASES[case]
    aspects = spread_attitudes(40)
    counts = count_in_frames(lidar, range_m, *aspects, 6)
    each = solve(lidar, range_m, *aspects, Finding())
    validation(
        case=f"a 3U CubeSat found at {range_m:.0f} m, all attitudes: {case}",
        source=f"{counts.size} simulated frames",
        expected=float((counts >= 1).mean()),
        got=float(each.mean()),
        tolerance=0.03 + 3.0 * math.sqrt(2.0) * standard_error(each, 6),
        unit="1",
    )


def test_attitudes_are_uniform_over_all_rotations_and_places_over_a_pixel():
    """The mean of D(1) and D(2) of the rotation group vanishes; a direction of the body covers the sphere evenly."""
    n = 1024
    matrices, phases = spread_attitudes(n)
    assert np.allclose(matrices @ np.swapaxes(matrices, 1, 2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(matrices), 1.0)
    # Of random attitudes each entry of the means has a standard error of 0.018 (variance 1/3), and of squares 0.0093.
    assert np.abs(matrices.mean(axis=0)).max() < 0.01
    assert np.abs((matrices**2).mean(axis=0) - 1.0 / 3.0).max() < 0.005
    # The angle of rotation has the density (1 - cos a) / π.
    angle = np.sort(np.arccos(np.clip(0.5 * (np.trace(matrices, axis1=1, axis2=2) - 1.0), -1.0, 1.0)))
    assert np.abs((angle - np.sin(angle)) / np.pi - (np.arange(n) + 0.5) / n).max() < 0.02
    for values in phases.T:
        assert np.abs(np.sort(values) + 0.5 - (np.arange(n) + 0.5) / n).max() < 0.01
    assert np.abs(np.corrcoef(phases.T)[0, 1]) < 0.02  # 0.031 of random ones
    assert np.allclose(face_direction(np.array([0.0, 1.0, 0.0])) @ [0.0, 1.0, 0.0], [0.0, 0.0, -1.0])
