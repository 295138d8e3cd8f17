"""`rso-lidar camera waveforms`: its table, its page, and what it refuses."""

from functools import partial

import pytest

from rso_lidar.evaluation.raw_waveforms import comparison
from tests.evaluation.raw_waveforms.recordings_for_tests import write_recording

SETTINGS = ("--set", "lidar.laser.pulse_fwhm_ns=15", "--set", "lidar.detector.readout.sample_ns=1.25")


@pytest.fixture
def call(rso_lidar, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "recording", 2)
    return partial(rso_lidar, "camera", "waveforms")


def test_a_table_is_printed_and_a_page_is_written(call, tmp_path, monkeypatch):
    monkeypatch.setattr(comparison, "_TRACES", 256)
    status, said, _ = call("gsfl_1064", "--data", "recording", *SETTINGS, "--flashes", "1", "-o", "a.html")
    assert status == 0
    assert "clip level over noise" in said and said.splitlines()[-1] == "a.html"
    assert said.splitlines()[1].split() == ["waveforms", "96", "96", "256"]  # the channels of one flash
    assert "Waveforms of recording" in (tmp_path / "a.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("gsfl_1064", "--data", "gone", *SETTINGS), "error: gone: no such file"),
        (("gsfl_1064", "--data", "recording"), "set lidar.detector.readout.sample_ns=1.25"),
        (
            ("geiger_1064", "--data", "recording", "--set", "lidar.detector.bin_ns=1.25"),
            "give a camera with one of type 'gsfl'",
        ),
        (("gsfl_1064", "--data", "recording", *SETTINGS, "-o", "a.csv"), "unknown suffix '.csv'"),
    ],
)
def test_bad_input_is_one_line(call, tmp_path, arguments, says):
    status, _, lines = call(*arguments)
    assert status == 2 and len(lines) == 1 and says in lines[0]
    assert not list(tmp_path.glob("a.*"))
