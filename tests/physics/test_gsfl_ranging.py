"""The full detector against estimation theory: precision, plateau, range walk, counts, several surfaces in a pixel.

Bands are 4 standard deviations of the draws on both sides (one in 16,000 fails by chance), unless a tolerance says
otherwise. A standard deviation of n normal draws strays by 1/sqrt(2n) of itself (chi-square).
"""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.detector import Amplifier, Apd, Gsfl, Ranging, Readout, Timing, Trigger, detect, make_plate, run_trial
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.time_axis import place_rows
from rso_lidar.optics import Laser, Receiver
from tests.detector.returns_for_tests import bell, returns, simulate_rows
from tests.optics import bench_for_tests as bench
from tests.physics import chain_by_hand as by_hand

C = by_hand.C_M_S
FWHM_S, SAMPLE_S, WIDTH_S = 8e-9, 2.38e-9, 8.516e-9
S_S = FWHM_S / by_hand.FWHM_PER_SIGMA
TAU_S = by_hand.pole_s(100e6)
T, AMPLIFIED = by_hand.amplified(FWHM_S, TAU_S, WIDTH_S)
TOP = float(AMPLIFIED.max())
STILL = Timing(pixel_jitter_ns=0.0)


def found(part, photons, n, seed=1):
    pulse = bell(FWHM_S)
    seen = make_plate(photons, n, (pulse["pulse_step_s"], pulse["pulse_power_per_s"]), FWHM_S, 1000.0)
    return run_trial(part, seen, np.random.default_rng(seed))


def averaged(covariance_at, weight=None, reach_s=math.inf):
    """Return the rms errors of range [m] and of height that `fit_sigmas` foretells, over 16 phases of the clock."""
    places = [(np.arange(20) - 9 + (phase + 0.5) / 16) * SAMPLE_S for phase in range(16)]
    errors = [by_hand.fit_sigmas(at, T, AMPLIFIED, covariance_at(at), weight, reach_s) for at in places]
    time_s, height = np.sqrt(np.mean(np.square(errors), axis=0))
    return C / 2 * time_s, height


# ----------------------------------------------------------------------------------------------------------- precision


@pytest.mark.parametrize("snr", [7, 10, 20, 50])
def test_precision_in_amplifier_noise_is_within_a_tenth_of_the_bound(validation, snr):
    """Cramer-Rao bound of a pulse of known shape and unknown height in two-pole noise (Kay 1993, eq. 3.31).

    SNR is the amplified pulse's top over the amplifier's rms; so many photons that their own noise is nil.
    """
    noise, n = 1e6, 16_384
    part = Gsfl(
        armed_from_m=980.0,
        armed_to_m=1020.0,
        apd=Apd(dark_current_na=0.0, statistics="gaussian"),
        amplifier=Amplifier(noise_electrons=noise),
        trigger=Trigger(
            threshold_electrons=max(5.0, 0.5 * snr) * noise, hysteresis_electrons=noise, threshold_spread_fraction=0.0
        ),
        readout=Readout(electrons_per_count=noise / 20, adc_bits=16),
        timing=STILL,
    )
    seen = found(part, snr * noise / (TOP * 8), n, seed=snr)
    bound = averaged(lambda at: by_hand.noise_covariance(20, SAMPLE_S, TAU_S) * (TOP / snr) ** 2)[0]
    got = float(seen.range_error_m.std())
    spread = by_hand.chi_square_spread(bound, len(seen.range_error_m))
    validation(
        case=f"range noise at SNR {snr}, amplifier noise alone: over the Cramer-Rao bound",
        source="Kay 1993, eq. 3.31; the project's limit is 1.10; chi-square, 4 sigma",
        expected=1.05,
        got=got / bound,
        tolerance=0.05 + spread / bound,
        unit="1",
    )
    validation(
        case=f"range bias at SNR {snr}, amplifier noise alone",
        source="no bias",
        expected=0.0,
        got=seen.range_bias_m,
        tolerance=4 * got / math.sqrt(n) + 1e-3,
        unit="m",
    )


def shot_covariance(photons, quantum_efficiency=0.8, excess=3.52):
    """Return what gives the covariance of samples of a pulse's shot noise, for a pulse as high as one electron's."""
    step_s = T[1] - T[0]
    light = np.exp(-4 * math.log(2) * (T / FWHM_S) ** 2)
    light /= light.sum()

    def covariance(at):
        since = np.maximum(at[:, None] - T, 0.0)
        h = WIDTH_S * since / TAU_S**2 * np.exp(-since / TAU_S)
        return (h * light) @ h.T * excess / (quantum_efficiency * photons)

    assert step_s < 0.01 * TAU_S
    return covariance


@pytest.mark.parametrize("photons", [1000, 10_000, 100_000])
def test_precision_in_shot_noise(validation, photons):
    """Without an amplifier's noise range scatters as s sqrt(F/(QE N)) (Johnson and Cain 2008) times 1.20.

    The limit is that of the mean of all arrival times. Behind 100 MHz 1.02 of it is left to the best fit; the matched
    filter weighs samples as if their noise were white, which costs another 1.17: worked out from its weights.
    """
    n = 16_384
    part = Gsfl(
        apd=Apd(dark_current_na=0.0),
        amplifier=Amplifier(noise_electrons=0.0),
        trigger=Trigger(threshold_electrons=4.0 * photons, hysteresis_electrons=1.0, threshold_spread_fraction=0.0),
        readout=Readout(electrons_per_count=photons / 250, quantised=False),
        timing=STILL,
    )
    seen = found(part, float(photons), n, seed=photons)
    limit = C / 2 * S_S * math.sqrt(by_hand.excess_noise(10.0, 0.2) / (0.8 * photons))
    fitted = averaged(shot_covariance(photons), np.eye(20), reach_s=6.5 * SAMPLE_S)[0]
    got = float(seen.range_error_m.std())
    validation(
        case=f"range noise of {photons} photons by their shot noise: fit with white weights",
        source="propagation of shot noise behind two poles; chi-square, 4 sigma",
        expected=100 * fitted,
        got=100 * got,
        tolerance=100 * by_hand.chi_square_spread(fitted, n) + 0.01 * 100 * fitted,
        unit="cm",
    )
    validation(
        case=f"range noise of {photons} photons by their shot noise: over s sqrt(F/(QE N))",
        source="Johnson and Cain 2008 is the limit; least squares in white light costs (8/sqrt(27))^(1/2) = 1.24",
        expected=1.12,
        got=got / limit,
        tolerance=0.12 + 4 / math.sqrt(2 * n),
        unit="1",
    )
    assert averaged(shot_covariance(photons))[0] / limit == pytest.approx(1.02, abs=0.01)


def test_the_plateau_of_5_cm_comes_from_the_jitter_alone(validation):
    """Fuller et al., sec. 3.3: 5 cm (1 sigma) with sufficient SNR. Without the pixels' jitter it would be below 3 cm."""
    n = 16_384
    jittered, still = found(Gsfl(), 30_000.0, n), found(Gsfl(timing=STILL), 30_000.0, n)
    alone = float(still.range_error_m.std())
    validation(
        case="range noise at 30,000 photons",
        source="Fuller et al., sec. 3.3: 5 cm with sufficient SNR",
        expected=5.0,
        got=100 * float(jittered.range_error_m.std()),
        tolerance=100 * (math.hypot(0.05, alone) - 0.05 + by_hand.chi_square_spread(0.05, n)) + 0.007,
        unit="cm",
    )
    validation(
        case="range noise at 30,000 photons, less what is left without jitter",
        source="0.334 ns of jitter in quadrature",
        expected=100 * 0.334e-9 * C / 2,
        got=100 * math.sqrt(float(jittered.range_error_m.var()) - alone**2),
        tolerance=100 * by_hand.chi_square_spread(0.0505, n),
        unit="cm",
    )
    assert alone < 0.03 and found(Gsfl(timing=STILL), 5000.0, n).range_error_m.std() < 0.03


# ------------------------------------------------------------------------------------------------------- walk


def edge(ratio, bandwidth_mhz, readout, correction=False):
    """Return mean and scatter of range error of a leading edge at 1/ratio of a pulse whose noise is nil."""
    photons = 1e8
    top = photons * 8 * by_hand.amplified(FWHM_S, by_hand.pole_s(bandwidth_mhz * 1e6), WIDTH_S)[1].max()
    part = Gsfl(
        apd=Apd(dark_current_na=0.0, statistics="gaussian"),
        amplifier=Amplifier(bandwidth_mhz=bandwidth_mhz, noise_electrons=0.0),
        trigger=Trigger(threshold_electrons=top / ratio, hysteresis_electrons=1.0, threshold_spread_fraction=0.0),
        readout=readout.replace(electrons_per_count=top / 40_000, adc_bits=16, quantised=False),
        ranging=Ranging(algorithm="leading_edge", walk_correction=correction),
        timing=STILL,
    )
    seen = found(part, photons, 128)
    assert seen.probability == 1.0
    return seen.range_bias_m, float(seen.range_error_m.std())


@pytest.mark.parametrize(("ratio", "published_cm"), [(1.5, -46), (2, -60), (5, -91), (10, -109), (50, -142)])
def test_range_walk(validation, ratio, published_cm):
    """A leading edge at T sees a Gaussian pulse of height A at -s sqrt(2 ln(A/T)) from its peak.

    The chain counts from the half height, which lies s sqrt(2 ln 2) before the peak; straight lines between samples
    0.34 ns apart are off by less than 0.3 cm. A bandwidth of 2 GHz leaves the pulse as it is; 100 MHz rounds it.
    """
    fast = Readout(sample_ns=0.34, samples=80, pretrigger_samples=40)
    half_m = C / 2 * S_S * math.sqrt(2 * math.log(2))
    validation(
        case=f"leading edge at 1/{ratio:g} of the peak: walk from the peak",
        source="s sqrt(2 ln(A/T)), 8 ns",
        expected=published_cm,
        got=100 * (edge(ratio, 2000.0, fast)[0] - half_m),
        tolerance=0.5 + 0.3,  # published to 1 cm
        unit="cm",
    )
    k = int(np.argmax(AMPLIFIED))
    rise_s = np.interp(TOP / np.array([ratio, 2.0]), AMPLIFIED[:k], T[:k])
    validation(
        case=f"leading edge at 1/{ratio:g} of the peak behind 100 MHz: walk from the half height",
        source="Gaussian pulse convolved with two poles",
        expected=100 * C / 2 * (rise_s[0] - rise_s[1]),
        got=100 * edge(ratio, 100.0, fast)[0],
        tolerance=0.3,
        unit="cm",
    )
    bias_m, scatter_m = edge(ratio, 100.0, Readout(), correction=True)
    validation(
        case=f"leading edge at 1/{ratio:g} of the peak, 2.38 ns samples, after walk correction",
        source="residual of a measured camera, 1.73 cm (Opt. Eng. 60(8) 083101)",
        expected=0.0,
        got=100 * bias_m,
        tolerance=1.73,
        unit="cm",
    )
    assert scatter_m < 0.03, "what is left from phase to phase of the clock"


# --------------------------------------------------------------------------------------------------------- counts


@pytest.mark.parametrize("photons", [2000, 10_000, 30_000, 60_000, 90_000])
def test_counts_are_linear_in_photons(validation, photons):
    """QE M electrons a photon, the amplified pulse's top of them, 200 to a count; 12 bits end at 109,000 photons."""
    n = 8192
    counts = found(Gsfl(), float(photons), n, seed=photons).intensity_counts.astype(float)
    expected = photons * 8 * TOP / 200
    validation(
        case=f"mean counts of {photons} photons",
        source="quantum efficiency x gain x amplified pulse's top",
        expected=expected,
        got=counts.mean(),
        tolerance=4 * counts.std() / math.sqrt(n) + 1e-3 * expected,
        unit="count",
    )


@pytest.mark.parametrize("photons", [2000, 10_000, 60_000])
def test_noise_of_counts(validation, photons):
    """Shot noise, dark current and amplifier through the matched filter's weights, and rounding: no other noise."""
    n, part = 8192, Gsfl()
    shot = shot_covariance(photons)
    dark_electrons = by_hand.excess_noise(10.0, 0.2) * 100 * 1e-9 / by_hand.CHARGE_C * WIDTH_S**2 / (4 * TAU_S)
    steady = by_hand.noise_covariance(20, SAMPLE_S, TAU_S)
    rms2 = (part.amplifier.noise_electrons**2 + dark_electrons + 200**2 / 12) / (8 * photons) ** 2
    weight = steady + 3e-3 * np.eye(20)
    _, height = averaged(lambda at: shot(at) + rms2 * steady, weight, 6.5 * SAMPLE_S)
    expected = math.hypot(height * 8 * photons * TOP / 200, 1 / math.sqrt(12))
    counts = found(part, float(photons), n, seed=photons).intensity_counts.astype(float)
    validation(
        case=f"standard deviation of counts, {photons} photons",
        source="propagation of shot, dark and amplifier noise; chi-square, 4 sigma",
        expected=expected,
        got=counts.std(),
        tolerance=by_hand.chi_square_spread(expected, n) + 0.01 * expected,
        unit="count",
    )


def test_noise_of_counts_ends_where_they_clip(validation):
    """Fuller et al., fig. 13: the standard deviation changes toward saturation; beyond it there is none."""
    validation(
        case="standard deviation of counts, 300,000 photons",
        source="12 bits: all the same",
        expected=0.0,
        got=float(found(Gsfl(), 3e5, 4096).intensity_counts.std()),
        tolerance=0.0,
        unit="count",
    )


def test_quantisation_adds_a_twelfth(validation):
    """The same flash converted with and without rounding: errors uniform over a count, 1/sqrt(12) rms."""
    pulse = bell(FWHM_S)
    seen = make_plate(3000.0, 4096, (pulse["pulse_step_s"], pulse["pulse_power_per_s"]), FWHM_S, 1000.0)
    whole, exact = (
        store_waveforms(camera_of(Gsfl(readout=Readout(quantised=quantised)), seen), seen, np.random.default_rng(2))[
            0
        ].samples_counts.astype(float)
        for quantised in (True, False)
    )
    assert np.array_equal(whole, np.rint(whole)) and np.abs(whole - exact).max() <= 0.5
    n = exact.size
    validation(
        case="rms of a sample's rounding",
        source="uniform over a count: 1/sqrt(12)",
        expected=1 / math.sqrt(12),
        got=float((whole - exact).std()),
        tolerance=4 * math.sqrt((1 / 80 - 1 / 144) / n) * math.sqrt(12) / 2,  # fourth moment of a uniform: 1/80
        unit="count",
    )


# ---------------------------------------------------------------------------------------- several surfaces in a pixel


@pytest.mark.parametrize("photons", [2000.0, 5000.0])
def test_two_surfaces_4_m_apart_are_two_returns(validation, photons):
    """An edge: half of the pixel at R, half at R + 4 m. Each is ranged as if it were alone.

    Two pulses 26.7 ns apart fit into the 20 samples where 3 of them lie before the latch.
    """
    n = 4096
    part = Gsfl(max_returns=3, readout=Readout(pretrigger_samples=3), timing=STILL)
    near_m = 1000.0 + np.modf(np.arange(n) * 0.618034)[0]
    truth_m = np.stack([near_m, near_m + 4.0], axis=1)
    seen = returns(truth_m.ravel(), photons, pixel=np.repeat(np.arange(n), 2), shape=(1, n))
    reading, _ = detect(seen, part, np.random.default_rng(4))
    ranges_m = reading.return_range_m[0].astype(float)
    count = np.isfinite(ranges_m).sum(axis=1)
    validation(
        case=f"edge of 4 m, {photons:g} photons each: share of pixels with two returns",
        source="two pulses, 3.3 widths apart",
        expected=1.0,
        got=float(np.mean(count == 2)),
        tolerance=1e-3,
        unit="1",
    )
    error_m = ranges_m[count == 2, :2] - truth_m[count == 2]
    alone = found(part, photons, n, seed=9)
    sigma_m = float(alone.range_error_m.std())
    within = np.abs(error_m) < 3 * sigma_m
    for k, name in enumerate(("near", "far")):
        validation(
            case=f"edge of 4 m, {photons:g} photons each: {name} surfaces ranged within 3 sigma",
            source="normal law, sigma of a surface alone",
            expected=0.9973,
            got=float(within[:, k].mean()),
            # a sigma 5 % higher where the other pulse is fitted away: 0.9957
            tolerance=0.0016 + 4 * math.sqrt(0.0043 / n),
            unit="1",
        )
        validation(
            case=f"edge of 4 m, {photons:g} photons each: mean range of {name} surfaces, off by",
            source="no bias",
            expected=0.0,
            got=100 * float(error_m[:, k].mean()),
            tolerance=100 * (4 * sigma_m / math.sqrt(n) + 1e-3),
            unit="cm",
        )


def test_a_facet_at_60_degrees_and_10_km_is_one_pulse(validation):
    """5.9 m deep in one pixel: a long pulse, the amplified one averaged over the depth, and not a comb of sub-rays."""
    lens = Receiver(
        fov_deg=2 * math.degrees(math.atan(math.tan(math.radians(1.25)) / 8)), n_rows=16, n_cols=16, f_number=2.8
    )
    laser = Laser(divergence_deg=lens.fov_deg, energy_mj=400.0)
    pose = bench.place((0, 0, 10_000.0), Rotation.from_euler("y", 60, degrees=True))
    seen = bench.look(bench.plate(400.0), pose, lens, laser)
    part = Gsfl(max_returns=4, armed_to_m=12_000.0, timing=STILL)

    # Along x the plate's range is R sqrt(1 + x^2 + y^2) / (1 + x tan 60), x and y tangents: pixel (8, 8) begins on the axis.
    pixel, tangent = 8 * 16 + 8, lens.ifov_rad
    x = np.array([tangent, 0.0])
    near_s, far_s = 2 / C * 1e4 * np.sqrt(1 + x**2 + (tangent / 2) ** 2) / (1 + x * math.tan(math.radians(60)))
    area = np.concatenate([[0.0], np.cumsum(0.5 * (AMPLIFIED[1:] + AMPLIFIED[:-1]) * np.diff(T))])
    plan = plan_time(part, FWHM_S)
    rows = place_rows(seen.photons, plan)
    made = simulate_rows(part, seen.photons, rows, None)
    worst, top = 0.0, 0.0
    for row in np.flatnonzero(rows.pixel == pixel):
        watched = np.arange(rows.first[row], rows.last[row])
        t = (rows.start[row] + watched) * plan.step_s
        slab = (np.interp(t - near_s, T, area) - np.interp(t - far_s, T, area)) / (far_s - near_s)
        expected = seen.by_pixel[8, 8] * 8 * slab
        worst = max(worst, float(np.abs(made.amplitude[row, watched] - expected).max()))
        top = max(top, float(expected.max()))
    validation(
        case="facet at 60 deg and 10 km: waveform without noise, worst sample over its top",
        source="amplified pulse averaged over 5.9 m of depth; the project's limit is 1 %",
        expected=0.0,
        got=worst / top,
        tolerance=0.01,
        unit="1",
    )
    reading, _ = detect(seen.photons, part, np.random.default_rng(3))
    count = np.isfinite(reading.return_range_m).sum(axis=2)
    validation(
        case="facet at 60 deg and 10 km: mean number of returns in a pixel",
        source="one surface; valleys of 3 sigma in the noise of a flat top part a pulse in one of 100 pixels",
        expected=1.0,
        got=float(count.mean()),
        tolerance=0.03,
        unit="1",
    )
