"""Laws: distributions against closed forms, and bounds that a law must have."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.dataset.specification.distributions import check_components

SHARE = np.random.Generator(np.random.Philox(5)).random((4000, 3))
CERTAIN = 1e-6  # probability of a false alarm of one test of a distribution


def draw(law):
    """Return 4000 values of a law."""
    return np.array([law.at(share[: law.dimensions]) for share in SHARE])


def test_uniform_and_log_uniform():
    assert stats.kstest(draw(rl.dataset.Uniform(low=-2, high=6)), stats.uniform(-2, 8).cdf).pvalue > CERTAIN
    assert stats.kstest(draw(rl.dataset.LogUniform(low=0.1, high=50)), stats.loguniform(0.1, 50).cdf).pvalue > CERTAIN


def test_sizes_by_a_power_law():
    # N(> x) of the NASA Standard Breakup Model, collisions: of fragments from 0.1 m, 0.1^1.71 / x^1.71 are larger than x
    drawn = draw(rl.dataset.PowerLaw(low=0.1, high=2.0, exponent=1.71))
    beyond = (0.1 / 2.0) ** 1.71
    assert stats.kstest(drawn, lambda x: (1.0 - (0.1 / x) ** 1.71) / (1.0 - beyond)).pvalue > CERTAIN
    with pytest.raises(rl.ScenarioError, match="power_law law needs low above 0"):
        rl.dataset.PowerLaw(low=0.0, high=2.0, exponent=1.71)


def test_vectors_are_drawn_by_component():
    drawn = draw(rl.dataset.Uniform(low=(0, 10, -1), high=(1, 20, 0)))
    assert drawn.shape == (4000, 3)
    assert (drawn.min(axis=0) >= [0, 10, -1]).all() and (drawn.max(axis=0) < [1, 20, 0]).all()
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 5 / np.sqrt(4000)


def test_normal_is_cut_off():
    law = rl.dataset.Normal(mean=3, sigma=2, low=2, high=8)
    assert stats.kstest(draw(law), stats.truncnorm(-0.5, 2.5, 3, 2).cdf).pvalue > CERTAIN


def test_whole_numbers_include_both_ends():
    drawn = draw(rl.dataset.WholeNumber(low=-1, high=3))
    assert set(drawn) == {-1, 0, 1, 2, 3}
    assert stats.chisquare(np.bincount(drawn + 1)).pvalue > CERTAIN


def test_choice_follows_its_weights():
    drawn = draw(rl.dataset.Choice(values=("a", "b", "c"), weights=(1, 2, 5)))
    counts = [int((drawn == name).sum()) for name in "abc"]
    assert stats.chisquare(counts, np.array([1, 2, 5]) / 8 * 4000).pvalue > CERTAIN


def test_rotations_are_uniform():
    # The angle of a rotation that is uniform on SO(3) has the density (1 - cos a) / pi (Miles 1965, Biometrika 52).
    turned = Rotation.from_quat(draw(rl.dataset.UniformRotation()))
    assert stats.kstest(turned.magnitude(), lambda a: (a - np.sin(a)) / np.pi).pvalue > CERTAIN
    x, y, z = turned.apply([0.0, 0.6, 0.8]).T
    for component in (x, y, z):  # Archimedes: each component of a uniform direction is uniform
        assert stats.kstest(component, stats.uniform(-1, 2).cdf).pvalue > CERTAIN


def test_a_cap_is_uniform_in_area():
    law = rl.dataset.UniformDirection(axis=(0, 3, 4), half_angle_deg=25)
    cosine = draw(law) @ [0, 0.6, 0.8]
    assert np.abs(np.linalg.norm(draw(law), axis=1) - 1).max() < 1e-10
    end = np.cos(np.radians(25))
    assert stats.kstest(cosine, stats.uniform(end, 1 - end).cdf).pvalue > CERTAIN


@pytest.mark.parametrize(
    ("even_in", "cumulative"),
    [
        ("volume", lambda r: (r**3 - 1e6) / (27e6 - 1e6)),
        ("radius", lambda r: (r - 100) / 200),
        ("log_radius", lambda r: np.log(r / 100) / np.log(3)),
    ],
)
def test_a_shell(even_in, cumulative):
    radius = np.linalg.norm(draw(rl.dataset.Shell(inner_m=100, outer_m=300, even_in=even_in)), axis=1)
    assert stats.kstest(radius, cumulative).pvalue > CERTAIN


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: rl.dataset.Uniform(low=3, high=1), "exchange"),
        (lambda: rl.dataset.Uniform(low=(0, 1), high=(1, 2, 3)), "one bound of each"),
        (lambda: rl.dataset.Uniform(low=1), "high"),
        (lambda: rl.dataset.LogUniform(low=0, high=1), "above 0"),
        (lambda: rl.dataset.Normal(mean=0, sigma=1), "low"),
        (lambda: rl.dataset.Normal(mean=0, sigma=1, low=20, high=30), "8 sigma"),
        (lambda: rl.dataset.WholeNumber(low=5, high=4), "exchange"),
        (lambda: rl.dataset.Choice(values=()), "values"),
        (lambda: rl.dataset.Choice(values=(1, 2), weights=(1,)), "one for each"),
        (lambda: rl.dataset.Shell(inner_m=5, outer_m=4), "exchange"),
        (lambda: rl.dataset.UniformDirection(axis=(0, 0, 0)), "zero"),
    ],
)
def test_a_law_without_bounds_is_refused(make, said):
    with pytest.raises(rl.ScenarioError, match=said):
        make()


def test_a_law_of_other_components_is_refused():
    with pytest.raises(rl.ScenarioError, match="2 numbers"):
        check_components(rl.dataset.Uniform(low=0, high=1), 2, "offset_fraction")
    with pytest.raises(rl.ScenarioError, match="a number"):
        check_components(rl.dataset.Choice(values=("near", "far")), 1, "range_m")
