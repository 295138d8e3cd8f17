"""Errors of element sets from their differences: known errors are found again, and real ones are of the known size."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import CatalogError, ScenarioError
from rso_lidar.orbit import Catalog, ElementSet
from rso_lidar.study import estimate_set_errors

EPOCH = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
RATE = 15.0  # rev/day
RADIUS_M = (units.EARTH_GM_M3_S2 / (RATE * math.tau / units.DAY_S) ** 2) ** (1.0 / 3.0)


def make_sets(count, *, anomaly_deg=0.0, rate=0.0, inclination_deg=0.0, every_days=0.4, seed=1):
    """Return sets of one polar object, on one orbit but for Gaussian errors of the given sizes.

    A polar orbit has no secular motion of its node by J2; the other secular rates are those that SGP4 itself gives.
    """
    rng = np.random.default_rng(seed)
    truth = ElementSet(
        name="KNOWN",
        norad_id=1,
        epoch_utc=EPOCH,
        mean_motion_rev_day=RATE,
        eccentricity=1e-6,
        inclination_deg=90.0,
        raan_deg=40.0,
        argument_of_perigee_deg=0.0,
        mean_anomaly_deg=0.0,
    )
    model = truth.satrec()
    per_day = 1440.0  # minutes
    sets = []
    for k in range(count):
        days = k * every_days
        perigee = math.degrees(model.argpdot * per_day * days)
        mean = math.degrees(model.mdot * per_day * days)
        sets.append(
            ElementSet(
                name="KNOWN",
                norad_id=1,
                epoch_utc=EPOCH + datetime.timedelta(days=days),
                mean_motion_rev_day=RATE + rate * rng.normal(),
                eccentricity=1e-6,
                inclination_deg=90.0 + inclination_deg * rng.normal(),
                raan_deg=40.0,
                bstar_per_earth_radius=0.0,
                argument_of_perigee_deg=perigee % 360.0,
                mean_anomaly_deg=(mean + anomaly_deg * rng.normal()) % 360.0,
            )
        )
    return sets


def test_sets_of_one_orbit_differ_by_nothing():
    found = estimate_set_errors(make_sets(20), [0.0, 2.0])
    assert found.pairs.tolist() == [19 + 18 + 17 + 16 + 15 - 15]  # 0.4 to 1.6 days: four later sets each
    assert found.sigma[0, :3].max() < 2.0


def test_an_error_along_the_track_is_found_in_both_sets():
    """Anomalies off by a normal number each: the difference has sqrt(2) of it, and no other direction has any."""
    error_deg = 0.01
    found = estimate_set_errors(make_sets(300, anomaly_deg=error_deg), [0.0, 1.0])
    expected = math.sqrt(2.0) * RADIUS_M * math.radians(error_deg)
    radial, along, across = found.sigma[0, :3]
    assert along == pytest.approx(expected, rel=4.0 / math.sqrt(2 * 300))  # pairs of one set are not independent
    assert found.inner_m[0, 1] == pytest.approx(expected, rel=0.2)
    assert radial < 0.02 * along
    assert across < 0.02 * along
    assert np.linalg.eigvalsh(found.covariance[0]).min() > -1e-6 * along**2


def test_an_error_of_the_period_grows_with_age():
    """The along-track difference is 2 pi a dn t, beside what the difference of the axes gives at once."""
    rate = 2e-5
    found = estimate_set_errors(make_sets(120, rate=rate, every_days=0.5), [0.75, 1.25, 3.75, 4.25])
    per_day = math.tau * RADIUS_M * rate
    assert found.sigma[0, 1] == pytest.approx(per_day * 1.0, rel=0.3)
    assert found.sigma[2, 1] == pytest.approx(per_day * 4.0, rel=0.3)
    first, second, third = found.age_days
    np.testing.assert_allclose(
        found.covariance_at(0.25 * second + 0.75 * third), 0.25 * found.covariance[1] + 0.75 * found.covariance[2]
    )
    np.testing.assert_array_equal(found.covariance_at(0.5 * first), found.covariance[0])
    middle = found.covariance_at(2.5 if second < 2.5 else 1.5)
    assert found.sigma[0, 1] < math.sqrt(middle[1, 1]) < found.sigma[2, 1]


def test_an_error_of_the_plane_is_across():
    found = estimate_set_errors(make_sets(200, inclination_deg=0.005), [0.0, 1.0])
    expected = math.sqrt(2.0) * RADIUS_M * math.radians(0.005) / math.sqrt(2.0)  # of a sine around the orbit
    assert found.sigma[0, 2] == pytest.approx(expected, rel=0.4)
    assert found.sigma[0, 0] < 0.1 * found.sigma[0, 2]


def test_few_pairs_have_no_covariance_and_ages_beyond_are_refused():
    found = estimate_set_errors(make_sets(4), [0.0, 1.0, 30.0])
    assert found.pairs[0] == 5
    assert np.isnan(found.covariance).all()
    assert found.table().splitlines()[2].split()[-1] == "-"
    assert np.isfinite(estimate_set_errors(make_sets(9), [0.0, 0.5]).covariance).all()  # eight pairs are enough
    assert np.isnan(estimate_set_errors(make_sets(8), [0.0, 0.5]).covariance).all()
    with pytest.raises(ScenarioError, match=r"^NORAD 1 KNOWN|^KNOWN.*: no age has 8 pairs"):
        found.covariance_at(1.0)
    with pytest.raises(ScenarioError, match=r"^age_days: 9 is beyond the known ages"):
        estimate_set_errors(make_sets(40), [0.0, 1.0]).covariance_at(9)


def test_one_set_other_objects_and_wrong_ages_are_refused():
    with pytest.raises(CatalogError, match=r"has one element set; differences need two"):
        estimate_set_errors(make_sets(1))
    other = ElementSet(**{**make_sets(1)[0].__dict__, "norad_id": 2})
    with pytest.raises(CatalogError, match=r"contains sets of"):
        estimate_set_errors([*make_sets(1), other])
    for ages in ([1.0], [1.0, 0.5], [-1.0, 1.0], "days"):
        with pytest.raises(ScenarioError, match=r"^ages_days: are not edges"):
            estimate_set_errors(make_sets(3), ages)


def test_real_sets_of_a_formation_are_consistent_within_hundreds_of_metres(shared):
    """GRACE-FO, which hardly manoeuvres: what element sets are said to be good for."""
    sets = Catalog.from_file(shared / "tle" / "pairs" / "gracefo_2026.tle").objects()[43476]
    found = estimate_set_errors(sets)
    assert (found.pairs > 100).all()
    assert 10.0 < found.inner_m[0, 0] < 200.0
    assert 20.0 < found.inner_m[0, 1] < 1000.0
    assert found.inner_m[-1, 1] > 2.0 * found.inner_m[0, 1]
