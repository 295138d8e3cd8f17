"""Reports of a recorded run: its scenario says how the camera packs words, and the frames hold what is needed."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError

BENCH = """
    version = 1
    name = "plate"
    world = { axes = "local" }
    time = { start_utc = 2026-01-01T00:00:00Z, duration_s = 0.2, frame_rate_hz = 10 }
    [[target]]
    name = "plate"
    model = "plate"
    motion = { type = "fixed", position_m = [150, 0, 0] }
    attitude = { type = "look_at", at = "follower" }
    [follower]
    motion = { type = "fixed", position_m = [0, 0, 0] }
    [lidar.laser]
    energy_mj = 50
    divergence_deg = 5
    [lidar.receiver]
    fov_deg = 5
    f_number = 2.8
    n_rows = 16
    n_cols = 16
"""


def run(folder, detector, name="run.h5"):
    scenario = rl.Scenario.loads(BENCH + detector)
    return rl.save(folder / name, rl.simulate(scenario))


def test_a_recording_becomes_the_words_that_its_scenario_states(tmp_path):
    path = run(tmp_path, "[lidar.detector]\ntype = 'gsfl'\nreport = { no_return_word = 192_000 }\n")
    with rl.open(path) as recording:
        rl.save(tmp_path / "run.raw", recording, frame_stride_bytes=2048, header_bytes=16)
        raw = np.fromfile(tmp_path / "run.raw", np.uint8)[16:].reshape(-1, 2048)
        words = raw[:, :1024].copy().view("<u4").reshape(-1, 16, 16)
        assert len(words) == len(recording) == 2
        for k, frame in enumerate(recording):
            valid = frame.valid
            assert 10 < valid.sum() < 256
            assert (words[k] >> 12)[valid] == pytest.approx(frame.range_m[valid] * 64 / 0.3048, abs=0.5)
            assert np.array_equal((words[k] & 0xFFF)[valid], frame.intensity_counts[valid])
            assert np.all(words[k][~valid] == 192_000 << 12)
        coarse = rl.detector.ReportWords(
            range_quantum_m=1.0, range_bits=10, intensity_bits=6, intensity_quantum_counts=64.0
        )
        rl.save(tmp_path / "coarse.raw", recording, report=coarse)
    assert (tmp_path / "coarse.raw").stat().st_size == 2 * 2 * 256


@pytest.mark.parametrize("suffix", ["h5", "npz"])
def test_flags_and_what_is_true_are_recorded(tmp_path, suffix):
    detector = "[lidar.detector]\ntype = 'gsfl'\nmax_returns = 2\nreport = { flags = true }\namplitude_crosstalk = {}\n"
    path = run(tmp_path, detector)
    with rl.open(path) as recording:
        frames = list(recording)
        made = list(rl.simulate(rl.Scenario.loads(BENCH + detector)))
        if suffix == "npz":
            rl.save(tmp_path / "run.npz", recording)
        rl.save(tmp_path / "run.raw", recording)
        assert np.array_equal(recording.flags.crosstalk[0], frames[0].observation.reading.crosstalk)
    for frame, fresh in zip(frames, made, strict=True):
        for record, other in ((frame.labels, fresh.labels), (frame.observation.reading, fresh.observation.reading)):
            for name in ("crosstalk", "saturated", "superimposed"):
                assert np.array_equal(getattr(record, name), getattr(other, name)), name
        assert frame.labels.crosstalk.sum() > 5 and frame.observation.reading.crosstalk.sum() > 5
    words = np.fromfile(tmp_path / "run.raw", "<u8").reshape(2, 2, 16, 16)  # frame, return
    assert np.array_equal(words[0, 0] >> 32 & 1, frames[0].observation.reading.crosstalk)
    if suffix == "npz":
        with np.load(tmp_path / "run.npz") as arrays:
            assert arrays["labels/superimposed"].dtype == arrays["superimposed"].dtype == np.uint8


def test_a_recording_without_words_or_flags_is_told_so(tmp_path):
    path = run(tmp_path, "[lidar.detector]\ntype = 'empirical'\n")
    with rl.open(path) as recording:
        with pytest.raises(RecordingError, match=r"states no words of its own; add \[lidar.detector.report\]"):
            rl.save(tmp_path / "run.raw", recording)
        with pytest.raises(RecordingError, match="has no flags; run the scenario with"):
            _ = recording.flags
        with pytest.raises(rl.RsoLidarError, match="has no flag 'crosstalk'"):
            rl.save(tmp_path / "run.raw", recording, report=rl.detector.ReportWords(flags=True))
    assert [file.name for file in tmp_path.iterdir()] == ["run.h5"]
