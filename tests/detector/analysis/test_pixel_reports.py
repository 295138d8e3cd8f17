"""The probability that a pixel reports one of its returns, against trials of the chain with the same light."""

from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import detect, make_plate, make_point_returns, report_probability

PULSE = rl.Laser().pulse
FWHM_S = 8e-9
N = 4096


def light(returns):
    """Return light with the same returns (range [m], photons, cluster) in each of many pixels."""
    range_m, photons, cluster = (np.array(values) for values in zip(*returns, strict=True))
    pixel = np.repeat(np.arange(N), len(returns))
    made = make_point_returns((1, N), PULSE, FWHM_S, pixel, np.tile(range_m, N), np.tile(photons, N).astype(float))
    clusters = cluster.max() + 1
    return rl.records.Photons(
        **{name: getattr(made, name) for name in made.__dataclass_fields__ if "cluster" not in name},
        cluster=(np.tile(cluster, N) + clusters * np.repeat(np.arange(N), len(returns))).astype(np.int32),
        cluster_pixel=np.repeat(np.arange(N), clusters).astype(np.int32),
    )


CASES = {
    "one return": ([(900.0, 760.0, 0)], [True]),
    "a body 1.2 m deep": ([(900.0 + 0.1 * k, 75.0, 0) for k in range(13)], [True] * 13),
    "two clusters of the body": ([(900.0, 620.0, 0), (912.0, 700.0, 1)], [True, True]),
    "another target in front": ([(900.0, 700.0, 0), (912.0, 900.0, 1)], [False, True]),
    "another target behind": ([(900.0, 700.0, 0), (912.0, 900.0, 1)], [True, False]),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("kind", ["gsfl", "empirical", "noisy"])
def test_pixels_report_as_often_as_in_trials(case, kind):
    """Within 0.03 and four standard errors; of trials each pixel is one, with its own threshold."""
    returns, mine = CASES[case]
    detectors = {
        "gsfl": rl.Gsfl(),
        "empirical": rl.Empirical(),
        "noisy": rl.Gsfl(
            trigger={"threshold_electrons": 5.5 * rl.Gsfl().noise_electrons, "threshold_spread_fraction": 0.1}
        ),
    }
    photons, mine = light(returns), np.tile(mine, N)
    if kind == "noisy":
        share = detectors[kind].traits.threshold_photons / rl.Gsfl().traits.threshold_photons
        photons = rl.records.Photons(**{**vars(photons), "photons": photons.photons * share})
    told = report_probability(detectors[kind], photons, mine)
    reading, _ = detect(photons, detectors[kind], np.random.Generator(np.random.Philox(3)))
    wanted_m = [range_m for (range_m, _, _), of in zip(returns, mine, strict=False) if of]
    near, far = min(wanted_m) - 4.0, max(wanted_m) + 4.0
    found = float(((reading.range_m > near) & (reading.range_m < far)).mean())
    assert told.shape == (N,)
    assert told.mean() == pytest.approx(found, abs=0.03 + 4.0 * np.sqrt(max(found * (1.0 - found), 1e-3) / N))


def test_settings_outside_the_closed_form_have_none():
    photons, mine = light([(900.0, 760.0, 0)]), np.ones(N, bool)
    for settings in ({"speckle": {}}, {"droop": {}}, {"maps": {}}, {"defects": {}}, {"crosstalk": {}}):
        assert report_probability(rl.Gsfl(**settings), photons, mine) is None
    assert report_probability(rl.Gsfl(ranging={"algorithm": "centroid"}), photons, mine) is not None


def test_nothing_is_reported_outside_the_armed_window():
    photons, mine = light([(900.0, 5000.0, 0)]), np.ones(N, bool)
    for detector in (rl.Gsfl(armed_from_m=1000.0), rl.Gsfl(armed_to_m=800.0), rl.Empirical(armed_to_m=800.0)):
        assert not report_probability(detector, photons, mine).any()


def test_a_geiger_array_reports_light_of_which_everything_is_known():
    """Images of the frame, such as the error of its sampling, have another shape than the pixels that are tried."""
    photons, mine = light([(900.0, 20.0, 0)]), np.ones(N, bool)
    of = photons.pixel < 2
    image = np.zeros((2, N // 2))
    lit = rl.records.Photons(
        **{name: getattr(photons, name) for name in ("pulse_step_s", "pulse_power_per_s", "pulse_fwhm_s", "late_s")},
        **{
            name: getattr(photons, name)[of]
            for name in ("pixel", "delay_s", "photons", "depth_spread_s", "coherence_cells", "hit", "cluster")
        },
        shape=image.shape,
        cluster_pixel=photons.cluster_pixel[:2],
        background_photons_per_s=image,
        photons_variance=image,
    )
    told = report_probability(rl.GeigerArray(gate_from_m=850.0, gate_to_m=950.0), lit, mine[of])
    assert (told[:2] > 0.9).all() and not told[2:].any()


@pytest.mark.parametrize(
    "detector",
    [
        rl.Gsfl(),
        rl.Gsfl(trigger={"threshold_electrons": 5.5 * rl.Gsfl().noise_electrons, "threshold_spread_fraction": 0.1}),
        rl.Empirical(),
        rl.GeigerArray(gate_from_m=850.0, gate_to_m=950.0),
    ],
    ids=["gsfl", "noisy", "empirical", "geiger"],
)
def test_flashes_listed_one_after_another_are_those_alone(detector):
    """The same pixels see each of them, under light and sunlight of its own."""
    n, levels = 50, (0.5, 1.0, 1.5)
    sunlight = np.linspace(0.0, 2e9, n)

    def flash(shares):
        photons = np.repeat(shares, n) * detector.traits.threshold_photons
        plate = make_plate(photons, len(photons), PULSE, FWHM_S, 900.0, len(shares))
        return replace(plate, background_photons_per_s=np.outer(shares, sunlight).reshape(1, -1))

    alone = [report_probability(detector, flash([share]), np.ones(n, bool)) for share in levels]
    listed = report_probability(detector, flash(levels), np.ones(3 * n, bool), flashes=3)
    # rates of false alarms are interpolated between the least and the greatest sunlight of a call, within 1e-4 of a rate
    np.testing.assert_allclose(listed, np.concatenate(alone), rtol=0, atol=1e-5)
