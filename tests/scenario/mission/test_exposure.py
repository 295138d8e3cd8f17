"""Exposures: pulses of a frame sent one after another, while targets, follower and PTU move."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import assign_pulses
from rso_lidar.records import Command
from tests.physics.test_exposure_physics import COUNTER, EXPOSURE_S, PIXEL_M, PULSES, RANGE_M, moving, scene

FACING = {"motion": {"type": "fixed", "position_m": [RANGE_M, 0, 0]}}
FEW = {"type": "gsfl", "gate": {"delay_ns": 620, "width_ns": 96, "pulses": 6}}


def same(one, other):
    """Return whether two frames have the same bits."""
    readings, labels = (
        [
            (vars(getattr(frame, name)) if name == "labels" else vars(frame.observation.reading))
            for frame in (one, other)
        ]
        for name in ("observation", "labels")
    )
    return all(
        np.array_equal(pair[0][name], pair[1][name], equal_nan=True)
        for pair in (readings, labels)
        for name in pair[0]
        if isinstance(pair[0][name], np.ndarray)
    )


@pytest.mark.parametrize("detector", [FEW, COUNTER])
def test_frames_alone_together_and_on_threads_are_the_same(detector):
    scenario = scene(moving([RANGE_M, 0, 0], [0.2, 0.6, 0]), detector=detector, rate_hz=50.0, frames=2, rays=4)
    whole = list(rl.simulate(scenario, threads=1))
    assert all(frame.truth.exposure is not None for frame in whole)
    assert not same(whole[0], whole[1])
    (alone,) = rl.simulate(scenario, frames=[1], threads=3)
    assert same(alone, whole[1])
    assert all(map(same, rl.simulate(scenario, lambda observation: None, threads=2), whole))


@pytest.mark.slow
def test_workers_change_no_bit():
    scenario = scene({"motion": {"type": "fixed", "position_m": [RANGE_M, 0, 0]}}, ptu=SCAN, detector=FEW, rate_hz=50.0)
    assert all(map(same, rl.simulate(scenario, workers=1), rl.simulate(scenario)))


SCAN = {"point": {"type": "scan", "pattern": "spiral", "radius_deg": 1, "step_deg": 0.5, "rate_deg_s": 10}}


def test_the_exposure_begins_at_the_frame_and_its_middle_is_the_time():
    scenario = scene(moving([RANGE_M, 0, 0], [0, 5, 0]), frames=2)
    for k, frame in enumerate(rl.simulate(scenario)):
        exposure = frame.truth.exposure
        assert frame.time_s == frame.truth.time_s == k + 0.5 * EXPOSURE_S
        assert frame.observation.settings["exposure_s"] == EXPOSURE_S
        of = assign_pulses(PULSES, len(exposure.time_s))
        assert exposure.time_s[of].mean() == pytest.approx(frame.time_s, abs=1e-12)
        place = exposure.pose("lidar", "plate").translation[:, 0]  # to the right: -y
        expected = -5.0 * (exposure.time_s - 0.5 * EXPOSURE_S)
        np.testing.assert_allclose(place, expected, atol=1e-9)
        assert len(exposure.time_s) == len(frame.truth.cast_epochs) < PULSES


def test_what_does_not_move_is_cast_once():
    """The same light as without a rate; only the time of the frame is that of its middle."""
    (spread,) = rl.simulate(scene(FACING), keep=["photons"])
    (together,) = rl.simulate(scene(FACING, rate_hz=None), keep=["photons"])
    assert spread.truth.exposure is None and same(spread, together)
    assert (spread.time_s, together.time_s) == (0.5 * EXPOSURE_S, 0.0)
    assert "exposure_s" not in together.observation.settings
    (moved,) = rl.simulate(scene(moving([RANGE_M, 0, 0], [0, 9, 0]), rate_hz=None))
    assert moved.truth.exposure is None


def test_a_command_acts_after_the_last_pulse():
    """The drive goes at its greatest rate from there on: frame 1 begins one period less one exposure later."""
    drive = {"type": "first_order", "time_constant_s": 0.001, "max_rate_deg_s": 0.5}
    scenario = scene(FACING, ptu={"response": drive}, detector=FEW, rate_hz=50.0, frames=2)
    frames = list(rl.simulate(scenario, lambda observation: Command(pan_rad=0.1)))
    length_s = 5 / 50.0
    exposure = frames[1].truth.exposure
    assert frames[0].truth.exposure is None and exposure is not None
    boresight = exposure.poses.place("follower", "lidar")[1][:, :, 2]
    pan_deg = np.degrees(np.arctan2(boresight[:, 1], boresight[:, 0]))
    np.testing.assert_allclose(pan_deg, 0.5 * (exposure.time_s - length_s), atol=2e-3)
    assert np.degrees(frames[1].truth.pointing.actual_rad[0]) == pytest.approx(0.5 * (1.0 - 0.5 * length_s), abs=2e-3)


def push(time_s, state, inputs):
    """Return the derivatives of position and velocity under an acceleration."""
    return np.concatenate([state[3:], inputs])


def test_commanded_inputs_hold_from_the_last_pulse_on():
    motion = {
        "type": "state_space",
        "axes": "local",
        "dynamics": push,
        "initial_state": (0.0,) * 6,
        "inputs": (0.0,) * 3,
    }
    scenario = scene(FACING, {"motion": motion}, detector=FEW, rate_hz=50.0, frames=2)
    frames = list(rl.simulate(scenario, lambda observation: Command(inputs={"follower": [0.0, 1.5, 0.0]})))
    exposure, length_s = frames[1].truth.exposure, 5 / 50.0
    at_m = exposure.poses.place("inertial", "lidar")[0][:, 1]
    np.testing.assert_allclose(at_m, 0.5 * 1.5 * (exposure.time_s - length_s) ** 2, rtol=1e-9)
    assert frames[0].truth.exposure is None


def test_jitter_of_pointing_holds_for_a_frame():
    ptu = SCAN | {"errors": {"jitter_deg": 0.5, "misalignment_deg": [0.2, 0.0]}}
    shaken, calm = (next(rl.simulate(scene(FACING, ptu=one, detector=FEW, rate_hz=50.0))) for one in (ptu, SCAN))
    apart = [
        np.subtract(*(frame.truth.exposure.poses.place("follower", "lidar")[1][:, 1, 2] for frame in (shaken, calm)))
    ]
    assert np.ptp(apart) < 1e-4 < np.abs(apart).min()


def test_a_motion_that_ends_during_the_last_exposure(tmp_path):
    """The error comes before the first frame, with its place."""
    for end_s, ends in ((1.03, True), (1.05, False)):
        (tmp_path / "path.csv").write_text(f"time_s,x_m,y_m,z_m\n0,100,0,0\n{end_s},100,1,0\n")
        target = {"motion": {"type": "table", "file": str(tmp_path / "path.csv")}}
        frames = rl.simulate(scene(target, frames=2))
        if ends:
            with pytest.raises(rl.RsoLidarError, match=r"plate\.motion.*path\.csv"):
                next(frames)
        else:
            assert len(list(frames)) == 2


def test_the_number_of_epochs():
    """No step over an eighth of a pixel, an eighth of the pulse (75 mm) or half a degree; one for each pulse at most."""
    for velocity, least in (
        ([0, 0.1 * PIXEL_M, 0], 1),
        ([0, PIXEL_M, 0], 10),
        ([0.3, 0, 0], 5),
        ([0, 50 * PIXEL_M, 0], PULSES),
    ):
        scenario = scene(moving([RANGE_M, 0, 0], np.array(velocity) / EXPOSURE_S), scale=0.1, rays=1)
        frame = next(rl.simulate(scenario))
        count = len(frame.truth.cast_epochs)
        assert count == least, velocity


def test_many_pulses_are_cast_at_64_epochs_at_most():
    gate = {"type": "gsfl", "gate": {"delay_ns": 620, "width_ns": 96, "pulses": 1000}}
    scenario = scene(moving([RANGE_M, 0, 0], [0, 300, 0]), detector=gate, rate_hz=1e4, rays=1)
    exposure = scenario.exposure
    assert 60 <= len(next(rl.simulate(scenario)).truth.cast_epochs) <= 64
    assert exposure.offsets_s(64)[0] == pytest.approx(-0.5 * exposure.length_s + 0.5 * 15 / 1e4)
    assert any("of a frame are cast at 64 epochs, and 1093 would be needed" in line for line in scenario.advice())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"rate_hz": 40.0},
            r"pulse_rate_hz: 48 pulses at 40 Hz take 1\.18 s, and frames follow each other after 1 s; raise it",
        ),
        ({"rate_hz": 0.0}, "pulse_rate_hz.*greater than 0"),
        ({"rate_hz": -5.0}, "pulse_rate_hz.*greater than 0"),
        ({"rate_hz": float("nan")}, "pulse_rate_hz.*finite"),
        ({"rate_hz": "fast"}, "pulse_rate_hz.*number"),
    ],
)
def test_rates_that_cannot_be(change, message):
    with pytest.raises(ScenarioError, match=message):
        scene(FACING, **change)


def test_check_says_how_far_things_move():
    scenario = scene(moving([RANGE_M, 0, 0], [1.0, 20.0, 0.0]))
    text = scenario.describe()
    assert "48 pulses at 1000 Hz, 0.047 s a frame, in which targets move at most 4.3" in text
    assert "mm along the line of sight, 0.5" in text and "cast at up to 48 epochs" in text
    assert any("targets move up to 4.31 pixels across the line of sight" in line for line in scenario.advice())
    assert "48 pulses, all sent at the frame's time" in scene(FACING, rate_hz=None).describe()
    assert "exposure" not in scene(FACING, rate_hz=None, detector={"type": "gsfl"}).describe()


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        ({"detector": {"type": "gsfl"}}, "pulse_rate_hz is not used: the detector takes one pulse a frame"),
        ({"rate_hz": 2e6}, "light from beyond 74.95 m comes after the next pulse, and the detector looks to 107.3 m"),
    ],
)
def test_advice(change, warning):
    assert any(warning in line for line in scene(FACING, **change).advice())
    assert not any("pulse" in line for line in scene(FACING, rate_hz=1e5).advice())


@pytest.mark.parametrize("drive", [{"type": "ideal"}, {"type": "second_order", "natural_hz": 8.0, "damping": 0.7}])
def test_a_tracked_target_does_not_smear(drive):
    """The follower flies by; its PTU keeps the target in the middle: what is left is the turn of the line of sight."""
    scenario = scene(
        FACING,
        moving([0, 0, 0], [0, 20, 0]),
        ptu={"point": {"type": "track", "at": "plate"}, "response": drive},
        scale=0.05,
    )
    (line,) = [line for line in scenario.describe().splitlines() if line.startswith("  exposure")]
    across = float(line.split("at most ")[1].split(" pixels")[0])
    assert (across < 0.1) == (drive["type"] == "ideal"), line  # the other drive starts at rest
