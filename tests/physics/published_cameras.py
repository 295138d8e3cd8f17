"""Published measurements of cameras and receivers, and the package's detectors set to them.

The numbers are facts that were read or computed for this comparison; no text or file of the sources is copied. Each
table says where its numbers stand, how they were read, and which parameters of the detector were free.
"""

from functools import cache

import numpy as np
from scipy import optimize, signal

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.detector import Amplifier, Apd, Readout, Timing, Trigger, make_point_returns, run_trial
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.geiger.histogram import count_photons

QUARTILES = 1.348_979_500_392_163_6  # between the quartiles of a normal distribution, over its sigma

# ------------------------------------------------------------------------------------ TMF8820: walk and counts of a flash
#
# C. Sifferman et al., ICCP 2025 Summer School on Single Photon Imaging, repository cpsiff/SPAD-ICCP-Summer-School at
# 6d924f9, part_2_active_SPADs/data/distance_data.json: raw histograms of an ams TMF8820, a camera of 3 x 3 zones that
# times single photons behind one flood of light at 940 nm. A robot held it square to a plane, 5 to 400 mm away. The bin
# of 91 ps is stated beside the data (activity3.py). The 4,000,000 iterations of a frame are those of the firmware that
# the course names (uwgraphics/ProximityPlanarRecovery, arduino.ino). Computed from the raw data: the counts above the
# median of the last 40 bins, and the centroid of the 9 neighbouring bins with most counts.

TMF_BIN_NS = 0.091
TMF_STATED_ITERATIONS = 4.0e6
TMF_ITERATIONS = 3.0e6  # free: found by the walk; the fall of the counts with range confirms it
TMF_RANGE_M = np.array(
    [0.055, 0.060, 0.065, 0.070, 0.080, 0.090, 0.100, 0.110, 0.125, 0.140, 0.155, 0.170, 0.190, 0.210, 0.235, 0.260,
     0.285, 0.315, 0.345, 0.370, 0.395]
)  # fmt: skip
TMF_THOUSAND_COUNTS = {
    0: [2199.0, 2024.6, 1864.4, 1709.7, 1435.6, 1215.2, 1033.4, 885.0, 718.9, 590.5, 495.4, 417.7, 338.9, 281.2, 229.6,
        188.1, 158.7, 130.9, 109.8, 95.1, 84.2],
    2: [2360.7, 2244.3, 2124.5, 2004.9, 1780.8, 1567.7, 1387.8, 1230.5, 1031.6, 874.6, 752.1, 643.8, 542.3, 451.9, 374.3,
        310.9, 263.5, 220.8, 186.6, 163.4, 146.7],
    4: [2321.2, 2389.2, 2410.6, 2402.7, 2325.5, 2201.8, 2056.5, 1916.1, 1700.4, 1506.7, 1331.6, 1173.6, 1004.8, 864.7,
        727.2, 621.5, 530.7, 443.1, 382.1, 334.2, 298.7],
    6: [2312.9, 2152.7, 2006.7, 1854.6, 1594.1, 1357.4, 1166.5, 1011.7, 827.4, 679.6, 576.8, 483.6, 393.5, 327.6, 269.1,
        220.6, 186.8, 152.7, 128.4, 112.5, 99.5],
    8: [2467.8, 2388.7, 2295.1, 2198.2, 1993.8, 1794.2, 1610.5, 1449.5, 1242.4, 1062.0, 921.6, 801.0, 675.4, 567.9, 466.4,
        392.8, 332.9, 278.3, 237.3, 207.7, 185.1],
}  # fmt: skip
TMF_CENTROID_BINS = {
    0: [16.857, 17.239, 17.714, 18.067, 18.896, 19.690, 20.357, 21.151, 22.264, 23.376, 24.465, 25.568, 27.062, 28.506,
        30.314, 32.144, 33.976, 36.110, 38.262, 40.103, 41.824],
    2: [16.498, 16.928, 17.306, 17.758, 18.485, 19.272, 20.040, 20.847, 21.964, 23.086, 24.175, 25.273, 26.770, 28.194,
        30.010, 31.819, 33.574, 35.709, 37.938, 39.672, 41.469],
    4: [16.876, 17.226, 17.666, 18.011, 18.813, 19.610, 20.301, 21.086, 22.206, 23.327, 24.405, 25.522, 27.013, 28.444,
        30.257, 32.055, 33.871, 35.976, 38.081, 39.891, 41.685],
    6: [17.168, 17.616, 17.990, 18.367, 19.181, 19.973, 20.761, 21.459, 22.574, 23.776, 24.869, 25.965, 27.385, 28.896,
        30.650, 32.477, 34.305, 36.448, 38.590, 40.416, 42.244],
    8: [17.659, 18.020, 18.424, 18.865, 19.700, 20.420, 21.203, 22.012, 23.161, 24.298, 25.415, 26.550, 28.065, 29.531,
        31.389, 33.239, 35.111, 37.285, 39.486, 41.327, 43.179],
}  # fmt: skip
# Mean histogram of the weak returns from beyond 0.33 m, in half bins from 4 bins before its centroid: 1/10,000 of all.
TMF_PULSE = np.array(
    [2, 19, 101, 350, 779, 1216, 1452, 1412, 1197, 916, 646, 435, 291, 203, 151, 120, 99, 83, 71, 61, 52, 45, 39, 34, 29,
     25, 22, 19, 16, 14, 12, 11, 9, 8, 7, 6, 5, 5, 4, 3, 3, 3, 2, 2, 2] + [1] * 23
)  # fmt: skip
TMF_FANO = {0: 1.021, 2: 1.066, 4: 1.071, 6: 1.005, 8: 1.021}  # variance over mean of 48 empty bins, +- 0.024 each


def tmf_array():
    """Return the camera as a Geiger-mode array: one count of a zone in an iteration, as the histogram has it."""
    return rl.GeigerArray(
        detection_efficiency=1.0, dark_count_rate_hz=0.0, hold_off_ns=100.0, jitter_ns=0.0, bin_ns=TMF_BIN_NS,
        gate_to_m=2.0, pulses=10_000, peak_ns=9 * TMF_BIN_NS, least_counts=1,
    )  # fmt: skip


@cache
def tmf_walk():
    """Return mean photons of an iteration, counts of an iteration, and the walk [m] that the array gives them."""
    step_s = 0.5 * TMF_BIN_NS * units.NS
    power = np.concatenate([np.zeros(len(TMF_PULSE)), TMF_PULSE]) / (TMF_PULSE.sum() * step_s)
    levels = np.array([0.02, 0.06, 0.12, 0.22, 0.36, 0.55, 0.8, 1.1, 1.5, 1.9])
    found = []
    for level in levels:
        n = round(max(6.0 / level, 12.0))
        places = 1.0 + np.modf(np.arange(n) * 0.618_034)[0] * TMF_BIN_NS * units.NS * units.RANGE_PER_DELAY_M_S
        light = make_point_returns((1, n), (step_s, power), 3e-10, np.arange(n), places, np.full(n, level))
        seen = run_trial(tmf_array(), light, np.random.default_rng(8), places)
        found.append(seen.range_error_m.mean())
    curve = np.polynomial.Polynomial.fit(levels, found, 4)
    fine = np.linspace(0.0, 1.9, 96)
    return fine, 1.0 - np.exp(-fine), curve(fine) - curve(0.0)


def tmf_deviations(iterations):
    """Return range [m], and for each zone: photons, measured and simulated deviation from a straight line [m].

    The line is fitted to the centroids less the simulated walk: its slope is the width of a bin and its offset the delay
    of the electronics, which are free in every zone.
    """
    _, shares, walk_m = tmf_walk()
    bins = np.stack([np.ones_like(TMF_RANGE_M), TMF_RANGE_M], axis=1)
    zones = {}
    for zone, centroid in TMF_CENTROID_BINS.items():
        share = np.array(TMF_THOUSAND_COUNTS[zone]) * 1000.0 / iterations
        walk = np.interp(share, shares, walk_m)
        per_m = 70.0  # bins, refined by two rounds
        for _ in range(3):
            line = np.linalg.lstsq(bins, np.array(centroid) - walk * per_m, rcond=None)[0]
            per_m = line[1]
        zones[zone] = (-np.log1p(-share), (np.array(centroid) - bins @ line) / per_m, walk)
    return TMF_RANGE_M, zones


# ------------------------------------------------------------------------- MIT: range error over the number of detections
#
# D. Shin, F. Xu, F. N. C. Wong, J. H. Shapiro and V. K. Goyal, "Computational multi-depth single-photon imaging", Opt.
# Express 24, 1873 (2016), data of repository photon-efficient-imaging/full-waveform, two_layer.mat: the times of all
# detections of 100 x 100 pixels by one SPAD, scanned. The authors' code gives 8 ps a bin (run_experiments.m of
# photon-efficient-imaging/uos-imaging) and a Gaussian response of 35 bins rms (main_experiment.m). Computed from the raw
# data: bins 4000 to 5000, which hold the scattering sheet in front; N detections drawn at random from each pixel that has
# at least 12 and N; centroid of the 200 bins with most of them; truth a cubic surface through the medians of all pixels.

MIT_BIN_NS = 0.008
MIT_GAUSSIAN_BINS = 35.0
MIT_DETECTIONS = np.array([1, 2, 4, 8, 16, 32])
MIT_SIGMA_PS = np.array([426.0, 294.2, 218.5, 151.8, 105.4, 69.3])  # quartiles over 1.349
MIT_PIXELS = np.array([6370, 6370, 6370, 6370, 5188, 2520])
MIT_BACKGROUND = 0.000_50 / 23.1  # counts in a bin for each count of the sheet, from the bins before it
# Detections of all pixels about the surface, in steps of 20 bins from -100 to 700 bins, background subtracted. The part
# beyond 400 bins is a second, weak surface.
MIT_RESPONSE = np.array(
    [0, 560, 33095, 40228, 41577, 38686, 29935, 17149, 7473, 4254, 4939, 4420, 4282, 3810, 2845, 1493, 668, 393, 237, 187,
     146, 128, 107, 155, 323, 1650, 1851, 1755, 1579, 1264, 919, 666, 560, 569, 486, 371, 355, 277, 339, 313]
)  # fmt: skip


def mit_sigma_ps(detections, gaussian):
    """Return robust sigma [ps] of the array's times that rest on so many counts in the gate, and how many pixels had them.

    Parameters
    ----------
    detections : counts of a pixel in the gate.
    gaussian : whether the response is the authors' Gaussian instead of the measured histogram.
    """
    step_s = (2 if gaussian else 20) * MIT_BIN_NS * units.NS
    if gaussian:
        power = np.exp(-0.5 * (np.arange(-100, 101) * 2 / MIT_GAUSSIAN_BINS) ** 2)
    else:
        power = np.concatenate([np.zeros(len(MIT_RESPONSE) - 5), MIT_RESPONSE.astype(float)])
    pulse = (step_s, power / (power.sum() * step_s))
    n, pulses = 16_000, 200
    light = make_point_returns((1, n), pulse, 1e-9, np.arange(n), np.full(n, 0.5), np.full(n, detections / pulses))
    bin_s = MIT_BIN_NS * units.NS
    array = rl.GeigerArray(
        detection_efficiency=1.0, dark_count_rate_hz=detections * MIT_BACKGROUND / (bin_s * pulses), hold_off_ns=100.0,
        jitter_ns=0.0, bin_ns=MIT_BIN_NS, gate_to_m=1000 * bin_s * units.RANGE_PER_DELAY_M_S, pulses=pulses,
        peak_ns=200 * MIT_BIN_NS, least_counts=1,
    )  # fmt: skip
    peaks = count_photons(array, light, np.random.default_rng(5))
    delay_ps = peaks.delay_s[peaks.total_counts == detections] / 1e-12
    low, high = np.quantile(delay_ps, [0.25, 0.75])
    return (high - low) / QUARTILES, len(delay_ps)


# --------------------------------------------------------------- VL53L5CX: reach over reflectance, sunlight and zone size
#
# STMicroelectronics, VL53L5CX data sheet DS13754 rev. 2 (August 2021), pages 19 to 23, read as text: eight cases of 90 %
# detection in tables 20 and 21, autonomous mode, integration time 5 ms, inner zones, typical. White is 88 % and grey
# 17 %, "measured 13 % in IR at 940 nm" (page 20); 5 klux is 2 W/m2 on the target at 940 nm. Tables step by 100 mm.

VL53_WHITE, VL53_GREY = 0.88, 0.13
VL53_REACH_M = {  # (zones, target, lit by the Sun): reach; a 4 x 4 zone has the light of four 8 x 8 zones
    ("8x8", "white", False): 1.9,
    ("8x8", "grey", False): 0.8,
    ("8x8", "white", True): 0.9,
    ("8x8", "grey", True): 0.5,
    ("4x4", "white", False): 3.0,
    ("4x4", "grey", False): 1.1,
    ("4x4", "white", True): 1.3,
    ("4x4", "grey", True): 0.8,
}
VL53_FREE = (("8x8", "white", False), ("8x8", "white", True))  # these two set the laser's power and the sunlight
VL53_DARK_COUNTS = 8.0  # of an 8 x 8 zone in a peak's window; assumed
_VL53_PULSES = 2500  # of an 8 x 8 zone; the four times as many detectors of a 4 x 4 zone count as four times the pulses


def vl53_reach_m(counts_at_1_m, noise_counts, zones, target):
    """Return the range [m] at which a Geiger-mode array detects 90 % of the returns.

    Parameters
    ----------
    counts_at_1_m : signal of a white 8 x 8 zone in a frame, at 1 m.
    noise_counts : of an 8 x 8 zone in the window of a peak.
    zones, target : key of `VL53_REACH_M`.
    """
    window_ns = 2.0
    array = rl.GeigerArray(
        detection_efficiency=1.0, dark_count_rate_hz=noise_counts / (_VL53_PULSES * window_ns * units.NS), hold_off_ns=1.0,
        jitter_ns=0.1, gate_to_m=4.5, pulses=_VL53_PULSES * (4 if zones == "4x4" else 1), peak_ns=window_ns,
    )  # fmt: skip
    pulse = rl.detector.LaserPulse(*rl.Laser(pulse_fwhm_ns=0.5).pulse, 0.5e-9)
    reflectance = (VL53_WHITE if target == "white" else VL53_GREY) / VL53_WHITE

    def excess(range_m):
        photons = counts_at_1_m * reflectance / range_m**2 / _VL53_PULSES
        return float(rl.detector.predict(array, pulse, np.array([photons]), np.zeros(1)).probability[0]) - 0.9

    return float(optimize.brentq(excess, 0.25, 30.0, xtol=1e-3))


@cache
def vl53_reaches_m():
    """Return the reach of each case, from the two that set signal and sunlight."""
    dark_key, lit_key = VL53_FREE
    signal = optimize.brentq(
        lambda s: vl53_reach_m(s, VL53_DARK_COUNTS, *dark_key[:2]) - VL53_REACH_M[dark_key], 5.0, 5000.0, xtol=0.1
    )
    sunlight = optimize.brentq(
        lambda b: vl53_reach_m(signal, VL53_DARK_COUNTS + b, *lit_key[:2]) - VL53_REACH_M[lit_key],
        1.0,
        40.0 * VL53_DARK_COUNTS,
        xtol=0.1,
    )
    reaches = {}
    for zones, target, lit in VL53_REACH_M:
        share = 1.0 if target == "white" else VL53_GREY / VL53_WHITE  # sunlight comes back from the target
        noise = VL53_DARK_COUNTS + (share * sunlight if lit else 0.0)
        reaches[zones, target, lit] = vl53_reach_m(signal, noise, zones, target)
    return reaches


# --------------------------------------------------------------- Receivers of avalanche photodiodes: jitter over signal
#
# A. Kilpelae and J. Kostamovaara, Proc. SPIE 3101 (1997), abstract: an optical pulse of 2.3 ns with a rise of 0.9 ns
# measured by a receiver of 800 MHz; signal to noise 80 (start) and 56 (stop); the discriminator uses the leading and the
# trailing edge; single-shot resolution 28.5 ps.
# A. Baharmast and J. Kostamovaara, Opt. Eng. 59(10), 104102 (2020), abstract: pulses of 3 ns FWHM; precision about 5 cm
# at a least signal to noise of about 10, by the zero crossing of a bipolar pulse.

KILPELAE_PS, KILPELAE_SNR = 28.5, (80.0, 56.0)
BAHARMAST_CM, BAHARMAST_SNR = 5.0, 10.0


def edge_jitter_ps(snr, rise_ns, fwhm_ns, bandwidth_mhz, edges, n=4000):
    """Return the jitter [ps] of half-height crossings on the stored samples of the full detector.

    Parameters
    ----------
    snr : top of the amplified pulse over the amplifier's rms noise; the light's own noise is left out.
    rise_ns, fwhm_ns : of the pulse behind the amplifier, 10 to 90 % and at half height [ns].
    bandwidth_mhz : of the amplifier [MHz].
    edges : "leading", or "both" for the mean of the crossings of both edges.
    n : pulses.
    """
    step_ns = 0.02
    t = np.arange(-400, 401) * step_ns
    pole_ns = Amplifier(bandwidth_mhz=bandwidth_mhz).pole_s / units.NS
    after_ns = np.arange(401) * step_ns
    response = after_ns / pole_ns**2 * np.exp(-after_ns / pole_ns)

    def light_of(edges_ns):
        return np.exp(-0.5 * (t / np.where(t < 0, edges_ns[0], edges_ns[1])) ** 2)

    def excess(edges_ns):
        trace = signal.fftconvolve(light_of(np.abs(edges_ns)), response)[: len(t)]
        trace /= trace.max()
        low, half, high = (np.interp(level, trace[: trace.argmax()], t[: trace.argmax()]) for level in (0.1, 0.5, 0.9))
        end = np.interp(-0.5, -trace[trace.argmax() :], t[trace.argmax() :])
        return [high - low - rise_ns, end - half - fwhm_ns]

    shape = np.abs(optimize.fsolve(excess, [0.4 * rise_ns, 0.7 * fwhm_ns]))
    power = light_of(shape)
    pulse = (step_ns * units.NS, power / (power.sum() * step_ns * units.NS))
    noise = 1e6
    amplifier = Amplifier(bandwidth_mhz=bandwidth_mhz, noise_electrons=noise, integration_ns=fwhm_ns)
    detector = rl.Gsfl(
        armed_from_m=80.0, armed_to_m=120.0, apd=Apd(dark_current_na=0.0, statistics="gaussian"), amplifier=amplifier,
        trigger=Trigger(threshold_electrons=0.7 * snr * noise, hysteresis_electrons=noise, threshold_spread_fraction=0.0),
        readout=Readout(
            sample_ns=0.1, samples=160, pretrigger_samples=60, electrons_per_count=noise * snr / 40_000, adc_bits=16,
        ),
        timing=Timing(pixel_jitter_ns=0.0),
    )  # fmt: skip
    photons = 1.0
    for _ in range(3):  # the top of the mean trace, to the signal wanted
        light = make_point_returns(
            (1, n), pulse, fwhm_ns * units.NS, np.arange(n), np.full(n, 100.0), np.full(n, photons * snr * noise / 8.0)
        )
        stored = store_waveforms(camera_of(detector, light), light, np.random.default_rng(3))[0]
        baseline = detector.readout.baseline_counts
        traces = np.asarray(stored.samples_counts, dtype=float) - baseline
        top = traces.mean(axis=0).max() / 40_000
        if abs(top - 1.0) < 0.01:
            break
        photons /= top
    half = 20_000.0
    peak = traces[:, 40:90].argmax(axis=1) + 40
    index = np.arange(traces.shape[1])
    start = np.asarray(stored.start_s, dtype=float) / 1e-12
    found = []
    for side in ("leading", "trailing") if edges == "both" else ("leading",):
        above = traces >= half
        if side == "leading":
            k = np.where((index < peak[:, None]) & ~above, index, -1).max(axis=1)
        else:
            k = np.where((index > peak[:, None]) & ~above, index, 10**6).min(axis=1) - 1
        row = np.arange(len(traces))
        before, after = traces[row, k], traces[row, k + 1]
        found.append(start + (k + (half - before) / (after - before)) * 100.0)
    return float(np.std(np.mean(found, axis=0)))


def zero_crossing_cm(snr, fwhm_ns, bandwidth_mhz, differentiator_ns, n=6000):
    """Return the range noise [cm] of a zero-crossing discriminator: amplifier noise alone, robust sigma.

    Parameters
    ----------
    snr : top of the bipolar pulse over the channel's rms noise.
    fwhm_ns : of the light's Gaussian pulse [ns].
    bandwidth_mhz, differentiator_ns : of the timing channel [MHz, ns].
    n : pulses.
    """
    laser = rl.Laser(pulse_fwhm_ns=fwhm_ns)
    photons = 2e7
    amplifier = Amplifier(bandwidth_mhz=bandwidth_mhz, noise_electrons=1.0, integration_ns=fwhm_ns)
    t = np.arange(-2000, 4000) * 0.005
    pole_ns, rate = amplifier.pole_s / units.NS, 1.0 / differentiator_ns
    light = np.exp2(-((2.0 * t / fwhm_ns) ** 2))
    light *= photons * 8.0 * fwhm_ns / (light.sum() * 0.005)  # quantum efficiency 0.8, gain 10
    after = np.arange(4000) * 0.005
    one = signal.fftconvolve(light, after / pole_ns**2 * np.exp(-after / pole_ns))[: len(t)] * 0.005
    top = (one - signal.fftconvolve(one, rate * np.exp(-rate * after))[: len(t)] * 0.005).max()
    noise = top / snr
    detector = rl.Gsfl(
        armed_from_m=80.0, armed_to_m=120.0, apd=Apd(dark_current_na=0.0, statistics="gaussian"), amplifier=amplifier,
        trigger=Trigger(threshold_electrons=0.3 * photons * 8.0, threshold_spread_fraction=0.0),
        readout=Readout(sample_ns=0.4, samples=64, pretrigger_samples=24, electrons_per_count=photons / 5000, adc_bits=16),
        timing=Timing(pixel_jitter_ns=0.0),
        zero_crossing=rl.detector.ZeroCrossing(
            differentiator_ns=differentiator_ns, noise_electrons=noise, arming_electrons=5.0 * noise, rail_electrons=1e12,
            hold_ns=2.0 * fwhm_ns,
        ),
    )  # fmt: skip
    places = 100.0 + np.modf(np.arange(n) * 0.618_034)[0]
    returns = make_point_returns((1, n), laser.pulse, laser.pulse_fwhm_s, np.arange(n), places, np.full(n, photons))
    return 100.0 * run_trial(detector, returns, np.random.default_rng(6), places).range_noise_m
