"""The avalanche: McIntyre's distribution, and draws from it that are held against direct ones and exact sums."""

import math

import numpy as np
import pytest
from scipy import stats

from rso_lidar.detector import Apd
from rso_lidar.detector.settings.apd import cumulants
from rso_lidar.detector.stages.avalanche import compound_pmf, mcintyre_pmf
from rso_lidar.errors import ScenarioError
from tests.detector.row_noise_for_tests import multiply
from tests.reference.detector.whole_chain import PATHS, computing

# McIntyre 1966, F = kM + (1-k)(2 - 1/M) at M = 10.
EXCESS = {0.02: 2.062, 0.2: 3.52, 0.4: 5.14}
DEVICES = [Apd(), Apd(gain=20.0, ionisation_ratio=0.4), Apd(ionisation_ratio=0.0), Apd(gain=1.0)]
NAMES = ["InAlAs", "InP", "electrons_only", "no_gain"]


@pytest.fixture(autouse=True, params=PATHS)
def path(request):
    """Run each test on the kernel and on its oracle: draws differ, their distributions do not."""
    with computing(request.param):
        yield


def rng(seed=1):
    return np.random.default_rng(seed)


def support(primaries, apd):
    first, pmf = mcintyre_pmf(primaries, apd.gain, apd.ionisation_ratio)
    return first + np.arange(len(pmf)), pmf


@pytest.mark.parametrize("k", EXCESS)
@pytest.mark.parametrize("primaries", [1, 24, 100])
def test_the_distribution_sums_to_one_and_has_mcintyres_mean_and_excess_noise(primaries, k):
    n, pmf = support(primaries, Apd(gain=10.0, ionisation_ratio=k))
    mean = (n * pmf).sum()
    variance = ((n - mean) ** 2 * pmf).sum()
    assert pmf.sum() == pytest.approx(1.0, abs=1e-9)
    assert mean == pytest.approx(10.0 * primaries, rel=1e-8)
    # the variance of the gain alone is M²(F − 1) a primary
    assert 1.0 + variance / (100.0 * primaries) == pytest.approx(EXCESS[k], abs=5e-5)
    assert Apd(gain=10.0, ionisation_ratio=k).excess_noise_factor == pytest.approx(EXCESS[k], abs=1e-9)


def test_the_electrons_of_several_primaries_are_the_sum_of_what_each_becomes():
    """P(n|a) is the a-fold convolution of P(n|1): avalanches do not know of each other."""
    single, triple = np.zeros(4000), np.zeros(4000)
    for primaries, into in ((1, single), (3, triple)):
        n, pmf = support(primaries, Apd())
        into[n[n < 4000]] = pmf[n < 4000]
    assert np.convolve(np.convolve(single, single), single)[:4000] == pytest.approx(triple, abs=1e-13)


def test_without_holes_the_gain_is_geometric():
    # k = 0 is Furry's (Yule's) process: P(n) = (1/M)(1 - 1/M)^(n-1).
    n, pmf = support(1, Apd(gain=10.0, ionisation_ratio=0.0))
    assert pmf == pytest.approx(stats.geom(0.1).pmf(n), rel=1e-10)


def test_without_gain_an_electron_stays_one():
    assert mcintyre_pmf(7, 1.0, 0.2)[0] == 7
    assert mcintyre_pmf(7, 1.0, 0.2)[1].tolist() == [1.0]
    assert Apd(gain=1.0).excess_noise_factor == 1.0
    assert compound_pmf(4.9, 1.0, 0.2)[:30] == pytest.approx(stats.poisson(4.9).pmf(np.arange(30)), abs=1e-14)


@pytest.mark.parametrize("apd", DEVICES, ids=NAMES)
def test_cumulants_are_the_moments_of_the_distribution(apd):
    n, pmf = support(1, apd)
    assert cumulants(apd) == pytest.approx([(n.astype(float) ** m * pmf).sum() for m in (1, 2, 3)], rel=1e-7)
    assert cumulants(apd)[1] == pytest.approx(apd.gain**2 * apd.excess_noise_factor, rel=1e-12)


def test_the_compound_distribution_is_poisson_times_mcintyre():
    exact = np.zeros(1500)
    for a in range(40):
        n, pmf = support(a, Apd())
        exact[n[n < 1500]] += stats.poisson(4.9).pmf(a) * pmf[n < 1500]
    assert compound_pmf(4.9, 10.0, 0.2)[:1200] == pytest.approx(exact[:1200], abs=1e-13)


@pytest.mark.parametrize("mean", [0.01, 0.7, 4.9, 30.0, 99.0, 101.0, 1000.0])
@pytest.mark.parametrize("apd", DEVICES, ids=NAMES)
def test_three_moments_of_the_draws(apd, mean):
    """Each within five standard errors (a chance of 6e-7), these taken from the draws' own higher moments."""
    n = 300_000
    x = multiply(np.full(n, mean), apd, rng(2), base=0.0).astype(float) - apd.gain * mean
    for power, moment in enumerate(cumulants(apd), start=1):
        expected = 0.0 if power == 1 else moment * mean  # the first three cumulants are the central moments
        error = (x**power).std() / math.sqrt(n)
        assert abs((x**power).mean() - expected) < 5.0 * error, power


@pytest.mark.parametrize(
    ("mean", "base"), [(0.7, None), (0.7, 0.0), (4.9, 4.89), (4.9, 4.9), (4.9, 3.2), (37.3, 4.9), (99.6, 0.0)]
)
@pytest.mark.parametrize("apd", DEVICES, ids=NAMES)
def test_draws_follow_the_exact_distribution_however_they_are_made_up(apd, mean, base):
    """Chi-square of 400,000 draws against the compound distribution at 1e-4, bins of 200 draws or more."""
    n = 400_000
    x = multiply(np.full(n, mean), apd, rng(3), base=base)
    pmf = compound_pmf(float(np.float32(mean)), apd.gain, apd.ionisation_ratio)
    assert np.array_equal(x, np.rint(x))
    seen = np.bincount(x.astype(int), minlength=len(pmf))
    assert len(seen) == len(pmf)  # beyond lies 1e-14
    edges = np.unique(np.searchsorted(np.cumsum(pmf), np.arange(1, 1000) / 1000))
    seen, expected = np.add.reduceat(seen, np.r_[0, edges + 1]), n * np.add.reduceat(pmf, np.r_[0, edges + 1])
    keep = expected > 200.0
    chi2 = ((seen - expected)[keep] ** 2 / expected[keep]).sum()
    assert keep.sum() >= 4
    assert stats.chi2(keep.sum() - 1).ppf(0.5e-4) < chi2 < stats.chi2(keep.sum()).isf(0.5e-4)


@pytest.mark.parametrize("apd", DEVICES[:2], ids=NAMES[:2])
def test_draws_agree_with_direct_ones(apd):
    """Two samples of 100,000, one from numpy's Poisson and the cumulated pmf of each avalanche: Kolmogorov-Smirnov, 1e-4."""
    n, pmf = support(1, apd)
    generator = rng(4)
    primaries = generator.poisson(12.5, 100_000)
    gains = n[np.minimum(np.searchsorted(np.cumsum(pmf), generator.random(primaries.sum())), len(n) - 1)]
    direct = np.add.reduceat(np.r_[gains, 0], np.r_[0, np.cumsum(primaries)[:-1]]) * (primaries > 0)
    assert stats.ks_2samp(direct, multiply(np.full(100_000, 12.5), apd, generator)).pvalue > 1e-4


def test_far_tails_are_mcintyres():
    """P(n > mean + 6 sd) at 5 primaries is 7.7e-4, 780,000 times the normal tail: 4 million draws, five standard errors."""
    apd, mean = Apd(), 5.0
    sd = math.sqrt(mean * cumulants(apd)[1])
    pmf = compound_pmf(mean, 10.0, 0.2)
    for deviations in (4.0, 6.0, 8.0):
        beyond = int(apd.gain * mean + deviations * sd) + 1
        expected = 4_000_000 * pmf[beyond:].sum()
        seen = (multiply(np.full(4_000_000, mean), apd, rng(5)) >= beyond).sum()
        assert abs(seen - expected) < 5.0 * math.sqrt(expected)
        assert expected > 10.0


def test_above_the_exact_range_tails_stay_near_mcintyres():
    """The match of three moments leaves the fourth: within a tenth at 101 primaries and 4 sd; a normal is 15 times low."""
    apd, mean, n = Apd(), 101.0, 4_000_000
    beyond = int(apd.gain * mean + 4.0 * math.sqrt(mean * cumulants(apd)[1])) + 1
    expected = n * compound_pmf(mean, 10.0, 0.2)[beyond:].sum()
    seen = (multiply(np.full(n, mean), apd, rng(6)) > beyond - 0.5).sum()
    assert seen / expected == pytest.approx(1.0, abs=0.1 + 5.0 / math.sqrt(expected))
    assert expected > 10 * n * stats.norm.sf(4.0)


def test_gaussian_statistics_keep_mean_and_variance_only():
    apd = Apd(statistics="gaussian")
    x = multiply(np.full(200_000, 50.0), apd, rng(7))
    z = (x - 500.0) / (10.0 * math.sqrt(3.52 * 50.0))
    edges = np.arange(-4.0, 4.0, 0.125) + 0.5 / 64.0  # between the values of the table of normal numbers
    below = np.searchsorted(np.sort(z), edges) / len(z)
    assert np.abs(below - stats.norm.cdf(edges)).max() < 2.2 / math.sqrt(len(z))  # Kolmogorov, 1e-4
    assert np.all(multiply(np.zeros(8), apd, rng(7)) == 0.0)


def test_every_step_keeps_its_own_mean():
    """Steps of all kinds in one array, some below the base: rows of 20,000 keep their means to five standard errors."""
    means = np.array([0.0, 1e-4, 0.5, 4.9, 4.9001, 8.0, 12.9, 57.3, 100.0, 100.1, 1e4])
    x = multiply(np.repeat(means[:, None], 20_000, axis=1), Apd(), rng(8), base=4.9)
    error = np.sqrt(352.0 * means / 20_000)
    assert x.shape == (11, 20_000) and x.dtype == np.float32
    assert np.all(x[0] == 0.0)
    assert np.all(np.abs(x.mean(axis=1) - 10.0 * means) <= 5.0 * error)
    assert np.corrcoef(x[2:]) == pytest.approx(np.eye(9), abs=5.0 / math.sqrt(20_000))


def test_the_same_generator_gives_the_same_bits():
    primaries = rng(9).exponential(30.0, (40, 96)).astype(np.float32)
    one, same, other = (multiply(primaries, Apd(), rng(seed)) for seed in (3, 3, 4))
    assert one.tobytes() == same.tobytes() != other.tobytes()
    assert multiply(np.zeros((0, 96)), Apd(), rng()).shape == (0, 96)


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_what_cannot_be_expected_is_refused(bad):
    with pytest.raises(ValueError, match="finite and not negative"):
        multiply(np.array([1.0, bad]), Apd(), rng())


def test_dark_current_is_charge_per_time():
    # 1 nA is 6.241509e9 elementary charges a second (SI).
    assert Apd(dark_current_na=1.0).dark_electrons_per_s == pytest.approx(6.241509e9, rel=1e-6)


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"gain": 0.9}, "gain"),
        ({"ionisation_ratio": 1.0}, "ionisation_ratio"),
        ({"gain": 300.0, "ionisation_ratio": 0.5}, "lower one"),
        ({"dark_current_na": -1.0}, "dark_current_na"),
        ({"statistics": "poisson"}, "mcintyre"),
    ],
)
def test_impossible_settings_are_refused_in_one_line(fields, what):
    with pytest.raises(ScenarioError, match=what) as caught:
        Apd(**fields)
    assert "\n" not in str(caught.value)


def test_a_gaussian_avalanche_has_no_longest_tail():
    assert Apd(gain=300.0, ionisation_ratio=0.5, statistics="gaussian").excess_noise_factor > 100.0
