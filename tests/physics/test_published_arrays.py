"""Published linear-mode arrays: errors of the highest cell, precision over counts, and quanta of a report.

What was free, what was not and what does not fit is said in `published_arrays.py` and in docs/calibration.md.
"""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import Droop, make_plate, run_trial
from tests.physics import published_arrays as published

AFIT = "Jordan 2009 (AFIT/GE/ENG/09-22), sec. 5.3.1"
PIXELL = "LeddarTech, Pixell user guide 54A0049 7.0, page 23"


def test_cells_alone_give_eight_centimetres(validation):
    """The pulse behind two poles falls more slowly than it rises, which moves the choice of the cell by 1.2 cm."""
    raw_cm, spline_cm = published.cell_errors_cm(100_000.0, is_ideal=True)
    validation(
        case="range by the highest of cells of 1.876 ns, without noise: rms error",
        source="uniform distribution over one cell, c/2 · cell / √12",
        expected=published.CELL_NS * 1e-9 * published.CM_PER_S / np.sqrt(12.0),
        got=raw_cm,
        tolerance=0.12,
        unit="cm",
    )
    assert spline_cm < 1.3  # four cells in a pulse are enough for a cubic


@pytest.mark.parametrize("pixels", [121, 500])
def test_an_early_ladar_with_maps_droop_and_noise(pixels, validation):
    """Spread of t0 and light are set by the spline's errors; the tolerance is the measured rms's, 4 / √(2n)."""
    raw_cm, spline_cm = published.cell_errors_cm(published.JORDAN_PHOTONS[pixels], droop=Droop())
    expected = published.JORDAN_SPLINE_CM[pixels]
    validation(
        case=f"range by the peak of a spline, {pixels} pixels, maps, droop and noise: rms error",
        source=AFIT,
        expected=expected,
        got=spline_cm,
        tolerance=4.0 * expected / np.sqrt(2.0 * pixels),
        unit="cm",
    )
    assert 16.0 < raw_cm < 22.0


def test_the_highest_cell_of_an_early_ladar_is_worse_than_simulated():
    """docs/calibration.md: 13 % too small for both regions, as if the highest cell had a common offset of 10 cm."""
    for pixels, ratio in ((121, 0.87), (500, 0.87)):
        raw_cm, _ = published.cell_errors_cm(published.JORDAN_PHOTONS[pixels], droop=Droop())
        measured = published.JORDAN_RAW_CM[pixels]
        assert raw_cm / measured == pytest.approx(ratio, abs=0.02)
        assert np.sqrt(measured**2 - raw_cm**2) == pytest.approx(10.5, abs=0.8)


def test_precision_is_flat_above_sixty_counts(validation):
    """The floor was set to the published 0.6 cm; a sigma of 4000 values by quartiles is known to 1.9 %."""
    for counts in (120.0, 600.0):
        validation(
            case=f"precision of a Pixell at {counts:g} counts",
            source=PIXELL,
            expected=published.PIXELL_FLOOR_CM,
            got=100.0 * published.pixell_trial(counts).range_noise_m,
            tolerance=0.08 * published.PIXELL_FLOOR_CM,
            unit="cm",
        )


def test_precision_below_sixty_counts_follows_the_amplitude(validation):
    """The guide names a radar equation: range noise as 1 over the amplitude. The exponent of four levels is known to 2 %."""
    counts = np.array([2.0, 3.0, 6.0, 12.0])
    noise_cm = np.array([100.0 * published.pixell_trial(level).range_noise_m for level in counts])
    above_floor = np.sqrt(noise_cm**2 - published.PIXELL_FLOOR_CM**2)
    validation(
        case="precision of a Pixell over counts, 2 to 12, floor removed: exponent",
        source=f"{PIXELL}: radar equation, 1 over the amplitude",
        expected=-1.0,
        got=float(np.polyfit(np.log(counts), np.log(above_floor), 1)[0]),
        tolerance=0.08,
        unit="1",
    )


def test_detection_of_a_pixell_needs_more_signal_than_it_states():
    """docs/calibration.md: 90 % at 0.0001 false alarms takes 12.9 dB of amplitude over noise, and 9.8 dB gives 35 %."""
    found = {
        db: published.pixell_trial(published.PIXELL_NOISE_COUNTS * 10.0 ** (db / 20.0)).probability
        for db in (published.PIXELL_SNR_DB, 12.9)
    }
    assert found[published.PIXELL_SNR_DB] == pytest.approx(0.35, abs=0.03)
    assert found[12.9] == pytest.approx(published.PIXELL_DETECTED, abs=0.02)


def test_words_of_a_tigercub_lose_nothing_that_the_default_has(validation):
    """64ths of a foot are 4.8 mm: their rounding adds 1.4 mm to 5 cm. 20 bits of them reach as far as the paper says."""
    full_m = 2**published.TIGERCUB_RANGE_BITS * published.TIGERCUB_QUANTUM_M
    detector = rl.Gsfl()
    validation(
        case="range at which the default detector is disarmed",
        source="TigerCub: 20 bits of 1/64 foot",
        expected=full_m,
        got=detector.armed_to_m,
        tolerance=50.0,  # Fuller et al. say 5 km, to one digit
        unit="m",
    )
    assert detector.readout.samples == published.TIGERCUB_SAMPLES
    assert detector.full_scale_counts < 2**published.TIGERCUB_INTENSITY_BITS
    light = make_plate(20_000.0, 4000, published.LASER.pulse, published.LASER.pulse_fwhm_s)
    ranges_m = 3000.0 + run_trial(detector, light, np.random.default_rng(4)).range_error_m
    rounded = np.round(ranges_m / published.TIGERCUB_QUANTUM_M) * published.TIGERCUB_QUANTUM_M
    added_mm = 1e3 * np.std(rounded - ranges_m)
    assert added_mm == pytest.approx(1e3 * published.TIGERCUB_QUANTUM_M / np.sqrt(12.0), rel=0.04)
    assert np.std(rounded) == pytest.approx(np.std(ranges_m), rel=0.002)
