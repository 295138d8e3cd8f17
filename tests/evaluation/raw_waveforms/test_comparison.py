"""Waveforms of an invented recording beside a simulated camera: what agrees, what differs, and what is written."""

import numpy as np
import pytest

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.evaluation import compare_waveforms
from rso_lidar.scenario import Lidar
from tests.evaluation.raw_waveforms.recordings_for_tests import FWHM_NS, RATIO, TOP_COUNTS, write_recording


def make_lidar(fwhm_ns=FWHM_NS, **detector):
    readout = {"sample_ns": 1.25, "adc_bits": 13, "electrons_per_count": 200.0}
    return Lidar(preset="gsfl_1064", laser={"pulse_fwhm_ns": fwhm_ns}, detector={"readout": readout, **detector})


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("pixset") / "invented", 4)


@pytest.fixture(scope="module")
def compared(recording):
    return compare_waveforms(recording, make_lidar())


def test_both_gains_stand_beside_the_simulation(compared):
    low, high = compared.measured
    assert (low.name, high.name, compared.simulated.name) == ("low gain", "high gain", "simulated")
    assert compared.gain_ratio == pytest.approx(RATIO, rel=0.01)
    # The Gaussian of 15 ns behind two poles of 100 MHz is longer by some 2 %.
    assert compared.simulated.fwhm_s == pytest.approx(1.02 * FWHM_NS * 1e-9, rel=0.02)
    assert max(map(compared.shape_difference, compared.measured)) < 0.02
    table = compared.table()
    assert "clip level over noise" in table and "amplitude, high over low gain" in table
    assert high.clip_counts == pytest.approx(TOP_COUNTS, abs=60.0)
    assert compared.simulated.clip_counts == pytest.approx(8191.0 - 64.0, abs=6.0)


def test_a_shape_that_the_chain_does_not_have_is_seen(recording, compared):
    """A super-Gaussian pulse of order 8 is flat: over its width it differs from a Gaussian by a tenth of the peak."""
    flat = make_lidar().replace(laser={"pulse_fwhm_ns": FWHM_NS, "pulse_shape": "super_gaussian", "pulse_order": 8})
    other = compare_waveforms(recording, flat)
    assert other.shape_difference(other.measured[1]) > 4.0 * compared.shape_difference(compared.measured[1])


def test_a_slow_amplifier_is_seen_in_the_noise(recording, compared):
    slow = compare_waveforms(recording, make_lidar(amplifier={"bandwidth_mhz": 40.0}))
    lag = [comparison.simulated.noise_correlation[1] for comparison in (compared, slow)]
    assert lag[1] > lag[0] + 0.3 and np.allclose(
        slow.measured[0].noise_correlation, compared.measured[0].noise_correlation
    )


def test_another_clock_is_refused_with_the_setting(recording):
    with pytest.raises(
        ScenarioError, match=r"samples every 1\.25 ns, and the camera every 2\.38; set .*sample_ns=1\.25"
    ):
        compare_waveforms(recording, Lidar(preset="gsfl_1064"))


def test_pages_and_pictures_are_written_once(compared, tmp_path):
    page = compared.save(tmp_path / "a.html").read_text(encoding="utf-8")
    assert "Waveforms of invented" in page and "clip level over noise" in page and "data:image" in page
    assert compared.save(tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(RecordingError, match="exists"):
        compared.save(tmp_path / "a.html")
    with pytest.raises(RecordingError, match="unknown suffix"):
        compared.save(tmp_path / "a.csv")
