"""The empirical detector against the statistics that it states: detection, false alarms, range and intensity noise.

Bands are 4 standard deviations of the number of draws, unless a tolerance says that a published figure is rounded.
"""

import math

import numpy as np
import pytest
from scipy import special, stats

from rso_lidar import detector
from rso_lidar.detector import Empirical
from tests.detector.returns_for_tests import STATED, nothing, returns

QUIET = Empirical(**STATED, false_alarms_per_s=0.0)
C = 299_792_458.0
N = 100_000


def drawn(range_m, photons, part=QUIET, seed=11, n=N, **settings):
    """Return the readings of n pixels that see the same."""
    return detector.detect(returns(np.full(n, float(range_m)), photons, **settings), part, np.random.default_rng(seed))[
        0
    ]


def probability(photons, nep=127.0, qe=0.8, excess=3.52, reference=1000.0):
    """Return the detection probability 0.5 erfc((T - S)/(sqrt 2 sigma)) (Richmond and Cain, SPIE TT85), by hand."""
    sigma = lambda n: math.sqrt(nep**2 + excess * n / qe)  # noqa: E731
    threshold = reference - stats.norm.ppf(0.95) * sigma(reference)
    return 0.5 * special.erfc((threshold - photons) / (math.sqrt(2) * sigma(photons)))


@pytest.mark.parametrize(
    ("photons", "published"), [(500, 0.03), (700, 0.32), (800, 0.60), (900, 0.83), (1000, 0.95), (1200, 0.999)]
)
def test_detection(validation, photons, published):
    """Preset noise_limited: 95 % at 1000 photons, and the table made from it, which gives two digits."""
    found = np.isfinite(drawn(1500.0, photons).range_m).mean()
    exact = probability(photons)
    sigma = math.sqrt(exact * (1 - exact) / N)
    validation(
        case=f"detection of {photons} photons",
        source="Gaussian threshold statistics (Richmond and Cain, TT85)",
        expected=exact,
        got=found,
        tolerance=4 * sigma,
        unit="1",
    )
    validation(
        case=f"detection of {photons} photons, table",
        source="Fuller et al., sec. 3.3 for 1000 photons; table of the preset",
        expected=published,
        got=found,
        tolerance=0.0055 + 4 * sigma,
        unit="1",
    )


@pytest.mark.parametrize(("nep", "qe", "excess", "reference"), [(37.5, 0.8, 3.52, 1000.0), (5.0, 0.7, 2.06, 30.0)])
def test_other_detectors_too_have_95_percent_where_they_say(validation, nep, qe, excess, reference):
    part = QUIET.replace(
        noise_equivalent_photons=nep, quantum_efficiency=qe, excess_noise_factor=excess, reference_photons=reference
    )
    for share in (0.8, 0.9, 1.0, 1.1):
        exact = probability(share * reference, nep, qe, excess, reference)
        found = np.isfinite(drawn(1500.0, share * reference, part).range_m).mean()
        validation(
            case=f"detection, NEP {nep:g}, 95 % at {reference:g}, {share * reference:g} photons",
            source="Gaussian threshold statistics",
            expected=exact,
            got=found,
            tolerance=4 * math.sqrt(exact * (1 - exact) / N),
            unit="1",
        )


@pytest.mark.parametrize(
    ("rate_per_s", "from_m", "to_m"), [(0.9, 1.0, 5000.0), (215.0, 1.0, 3000.0), (5000.0, 1000.0, 3000.0)]
)
def test_false_alarms_of_a_dark_frame(validation, rate_per_s, from_m, to_m):
    """Each pixel waits for its first false trigger: 1 - exp(-rate x window) of them, window 2 (to - from)/c."""
    part = Empirical(**STATED, false_alarms_per_s=rate_per_s, armed_from_m=from_m, armed_to_m=to_m)
    pixels = 4_000_000 if rate_per_s < 1 else 400_000
    reading, _ = detector.detect(nothing((1000, pixels // 1000)), part, np.random.default_rng(5))
    alarms = reading.range_m[np.isfinite(reading.range_m)].astype(float)
    p = -math.expm1(-rate_per_s * 2 * (to_m - from_m) / C)
    validation(
        case=f"false alarms at {rate_per_s:g}/s over {from_m:g} to {to_m:g} m, {pixels:,} pixels",
        source="Poisson",
        expected=p * pixels,
        got=len(alarms),
        tolerance=4 * math.sqrt(p * (1 - p) * pixels),
        unit="1",
    )
    assert np.all((alarms >= from_m - 1e-3) & (alarms <= to_m + 1e-3))  # ranges are float32
    # Waiting is exponential, cut at the window's end; at low rates that is uniform.
    waited = -np.expm1(-rate_per_s * 2 * (alarms - from_m) / C) / p
    assert stats.kstest(waited, "uniform").pvalue > 1e-3
    if rate_per_s < 1000:
        assert stats.kstest((alarms - from_m) / (to_m - from_m), "uniform").pvalue > 1e-3
    counts = reading.intensity_counts[np.isfinite(reading.range_m)]
    least = int(part.threshold_photons * part.counts_per_photon)
    assert counts.min() >= least and counts.max() < 2 * least + 20  # noise that just passed


def test_false_alarms_come_before_the_true_return_and_take_its_place(validation):
    """A gate of 2 x 4000 m / c at 20,000/s: 41 % of bright pixels at 4 km latch on noise first."""
    part = Empirical(**STATED, false_alarms_per_s=20_000.0)
    ranges = drawn(4000.0, 1e6, part).range_m.ravel().astype(float)
    p = -math.expm1(-20_000 * 2 * (4000.0 - 1.0) / C)
    early = ranges < 3999.0
    assert np.isfinite(ranges).all() and not np.any(ranges > 4001)
    validation(
        case="false alarms before a bright return at 4 km, 20,000/s",
        source="Poisson",
        expected=p,
        got=early.mean(),
        tolerance=4 * math.sqrt(p * (1 - p) / N),
        unit="1",
    )


def test_a_later_start_of_the_window_lets_fewer_pre_empt(validation):
    part = Empirical(**STATED, false_alarms_per_s=20_000.0, armed_from_m=3500.0, armed_to_m=4500.0)
    ranges = drawn(4000.0, 1e6, part).range_m.ravel().astype(float)
    p = -math.expm1(-20_000 * 2 * 500.0 / C)
    validation(
        case="the same, armed from 3.5 km",
        source="Poisson",
        expected=p,
        got=(ranges < 3999).mean(),
        tolerance=4 * math.sqrt(p * (1 - p) / N),
        unit="1",
    )


def formula_m(photons, plateau=0.05, nep=127.0, qe=0.8, excess=3.52, fwhm_ns=8.0, sample_ns=2.38):
    """Return plateau + (c/2)^2 [s^2 F/(QE N) + 2 s dt/sqrt(pi) (NEP/N)^2], in quadrature, worked out here."""
    s, dt = fwhm_ns * 1e-9 / 2.354820045, sample_ns * 1e-9
    shot = s**2 * excess / (qe * photons)
    white = 2 * s * dt / math.sqrt(math.pi) * (nep / photons) ** 2
    return math.sqrt(plateau**2 + (C / 2) ** 2 * (shot + white))


@pytest.mark.parametrize(("photons", "fwhm_ns"), [(1000.0, 8.0), (1000.0, 6.0), (2000.0, 8.0), (1e4, 10.0), (1e6, 8.0)])
def test_range_noise(validation, photons, fwhm_ns):
    """Sample variance of n draws: n s^2/sigma^2 is chi-square, so s is off by sigma/sqrt(2n)."""
    ranges = drawn(300.0, photons, pulse_fwhm_s=fwhm_ns * 1e-9).range_m.astype(float)
    ranges = ranges[np.isfinite(ranges)]
    sigma = formula_m(photons, fwhm_ns=fwhm_ns)
    validation(
        case=f"range noise at {photons:g} photons, {fwhm_ns:g} ns",
        source="shot noise and matched filter, in quadrature",
        expected=sigma,
        got=ranges.std(ddof=1),
        tolerance=4 * sigma / math.sqrt(2 * len(ranges)),
        unit="m",
    )
    validation(
        case=f"mean range at {photons:g} photons, {fwhm_ns:g} ns",
        source="no bias",
        expected=300.0,
        got=ranges.mean(),
        tolerance=4 * sigma / math.sqrt(len(ranges)) + 2e-5,
        unit="m",
    )
    assert stats.kstest((ranges - 300) / sigma, "norm").pvalue > 1e-3


def test_range_noise_has_the_paper_s_plateau(validation):
    """Fuller et al., sec. 3.3: a nominal precision (1 sigma) of 5 cm with sufficient SNR, degrading as the SNR decreases."""
    high, low = (drawn(300.0, n).range_m.astype(float) for n in (1e5, 900.0))
    validation(
        case="range noise with sufficient SNR",
        source="Fuller et al., sec. 3.3",
        expected=0.05,
        got=np.nanstd(high),
        tolerance=0.001,
        unit="m",
    )
    assert np.nanstd(low) > 1.3 * np.nanstd(high)


@pytest.mark.parametrize(("photons", "shot_cm"), [(1000, 3.4), (300, 6.2), (100, 10.7), (30, 19.5)])
def test_shot_noise_limit_of_range(validation, photons, shot_cm):
    """s sqrt(F/(QE N)) (Johnson and Cain, Appl. Opt. 47, 5147, 2008), 8 ns, F = 3.52, QE = 0.8."""
    part = QUIET.replace(range_plateau_m=0.0, noise_equivalent_photons=1e-6, range_noise_equivalent_photons=0.0)
    validation(
        case=f"range noise by shot noise alone, {photons} photons",
        source="Johnson and Cain 2008",
        expected=shot_cm,
        got=100 * float(part.range_noise_m(np.array(float(photons)), 8e-9)),
        tolerance=0.06,
        unit="cm",
    )


@pytest.mark.parametrize("snr", [5, 10, 50])
def test_white_noise_limit_of_range(validation, snr):
    """Cramer-Rao bound of a known Gaussian pulse in white noise: 45.3 cm/SNR for 8 ns sampled every 2.38 ns.

    The bound is summed here over the samples themselves: 1/sigma_t^2 = SNR^2 sum (g'(t_i))^2.
    """
    s, dt = 8.0 / 2.354820045, 2.38
    t = np.arange(-40, 41) * dt + 0.3
    fisher = np.sum((t / s**2 * np.exp(-(t**2) / (2 * s**2))) ** 2)
    bound_cm = 100 * C / 2 * 1e-9 / (snr * math.sqrt(fisher))
    assert bound_cm == pytest.approx(45.3 / snr, rel=2e-3)
    part = QUIET.replace(
        range_plateau_m=0.0,
        range_noise_equivalent_photons=1e4,
        range_excess_noise_factor=1.0,
    )
    photons = snr * 1e4
    shot = C / 2 * 1e-9 * s / math.sqrt(0.8 * photons)
    total_m = float(part.range_noise_m(np.array(photons), 8e-9))
    validation(
        case=f"range noise by amplifier noise alone, SNR {snr}",
        source="Cramer-Rao bound summed over samples",
        expected=bound_cm,
        got=100 * math.sqrt(total_m**2 - shot**2),
        tolerance=2e-3 * bound_cm,
        unit="cm",
    )


@pytest.mark.parametrize("photons", [3000.0, 10_000.0, 50_000.0])
def test_intensity_is_linear_below_the_bend(validation, photons):
    """Fuller et al., fig. 13: counts per photon are constant; x/(1+(x/s)^4)^(1/4) is within 0.6 % up to 2000 of 5000."""
    counts = drawn(300.0, photons).intensity_counts.astype(float)
    sigma = 0.04 * math.sqrt(127.0**2 + 3.52 * photons / 0.8)
    validation(
        case=f"mean counts of {photons:g} photons",
        source="0.04 counts per photon",
        expected=0.04 * photons,
        got=counts.mean(),
        tolerance=0.0065 * 0.04 * photons + 4 * sigma / math.sqrt(N),
        unit="count",
    )


def test_intensity_noise_changes_toward_saturation(validation):
    """Fuller et al., sec. 3.3: mostly Gaussian, but the standard deviation changes as the detector approaches saturation.

    In the linear regime it is that of the photons, by 0.04; where the curve bends it shrinks with the curve's slope
    (1 + (x/s)^4)^(-5/4); where it clips there is none.
    """
    part = QUIET.replace(counts_per_photon=0.04)
    for photons in (10_000.0, 100_000.0):
        x = 0.04 * photons / 5000.0
        slope = (1 + x**4) ** -1.25
        counts = drawn(300.0, photons, part).intensity_counts.astype(float)
        sigma = math.sqrt((0.04 * slope) ** 2 * (127.0**2 + 3.52 * photons / 0.8) + 1 / 12)  # rounding to counts
        validation(
            case=f"counts' standard deviation at {photons:g} photons",
            source="photon noise through the curve's slope",
            expected=sigma,
            got=counts.std(ddof=1),
            tolerance=4 * sigma / math.sqrt(2 * N) + 0.01 * sigma,
            unit="count",
        )
    clipped = drawn(300.0, 1e6, part)
    assert np.all(clipped.saturated == 1) and np.all(clipped.intensity_counts == 4095)
    validation(
        case="counts' standard deviation where the converter clips",
        source="12 bits",
        expected=0.0,
        got=clipped.intensity_counts.std(),
        tolerance=0.0,
        unit="count",
    )
