"""Screening one object against thousands for a day, beside sgp4 and numpy on a coarse grid, in one run.

The plain way flies all objects every 60 s and takes each dip of the range below the limit; with 60 s steps it sees only
the slow ones (at 10 km/s a pass within 50 km lasts ten seconds), so the counts stand beside the times.
"""

import datetime
import os
import time
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.orbit import Catalog, ElementSet, screen, screen_pairs

WITHIN_M = 50e3


def plain(follower, objects, start_utc, duration_s, within_m, step_s=60.0):
    """Return how many dips below the limit sgp4 and numpy see on a coarse grid, all objects at all instants."""
    from sgp4.api import SatrecArray, jday

    time_s = np.arange(0.0, duration_s + 1e-6, step_s)
    whole, fraction = jday(*start_utc.timetuple()[:6])
    dates = np.full(time_s.shape, whole), fraction + time_s / units.DAY_S
    _, lead, _ = SatrecArray([follower.satrec()]).sgp4(*dates)
    models = [entry.satrec() for entry in objects]
    dips = 0
    for begin in range(0, len(models), 250):
        _, position, _ = SatrecArray(models[begin : begin + 250]).sgp4(*dates)
        apart = np.linalg.norm(position - lead, axis=2) * units.KM
        dips += int(
            ((apart[:, 1:-1] < apart[:, :-2]) & (apart[:, 1:-1] <= apart[:, 2:]) & (apart[:, 1:-1] < within_m)).sum()
        )
    return dips


def real(n_objects):
    """Return a follower and so many objects of a real catalogue of RSO_LIDAR_SHARED, or None without one."""
    path = Path(os.environ.get("RSO_LIDAR_SHARED", ""), "tle", "catalogs", "celestrak_active_2026-05-07.tle")
    if not path.is_file():
        return None
    sets = list(Catalog.from_file(path))
    follower = next(entry for entry in sets if entry.norad_id == 31698)  # TerraSAR-X, at 514 km among the crowd
    others = [entry for entry in sets if entry.norad_id != 31698]
    chosen = np.random.default_rng(3).permutation(len(others))[:n_objects]
    return follower, [others[k] for k in chosen]


def synthetic(n_objects):
    """Return a follower and so many objects in its own shell, the worst case: no shell is left out."""
    rng = np.random.default_rng(5)
    columns = rng.uniform(
        [15.0, 0.0, 40.0, 0.0, 0.0, 0.0], [15.4, 0.004, 100.0, 360.0, 360.0, 360.0], (n_objects + 1, 6)
    )
    sets = [
        ElementSet(
            name=f"OBJECT {k}",
            norad_id=k + 1,
            epoch_utc=datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC),
            mean_motion_rev_day=float(row[0]),
            eccentricity=float(row[1]),
            inclination_deg=float(row[2]),
            raan_deg=float(row[3]),
            argument_of_perigee_deg=float(row[4]),
            mean_anomaly_deg=float(row[5]),
            bstar_per_earth_radius=1e-5,
        )
        for k, row in enumerate(columns)
    ]
    return sets[0], sets[1:]


def encounters(n_objects=5000, days=1.0, repeats=3):
    """Print the best seconds of both ways for one against `n_objects`, and what each of them finds."""
    start_utc = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
    print(f"\nencounters: 1 against {n_objects:,} for {days:g} days, within {WITHIN_M / units.KM:g} km")
    print(f"  {'catalogue':<12}{'ours, s':>9}{'found':>8}{'60 s grid, s':>15}{'found':>8}{'ratio':>8}")
    for name, made in (("real", real(n_objects)), ("synthetic", synthetic(n_objects))):
        if made is None:
            print(f"  {name:<12}  RSO_LIDAR_SHARED names no catalogue")
            continue
        spans = {}
        for _ in range(repeats):
            for way in (screen, plain):
                began = time.perf_counter()
                result = way(*made, start_utc, days * units.DAY_S, WITHIN_M)
                seconds, _ = spans.get(way, (np.inf, None))
                spans[way] = min(seconds, time.perf_counter() - began), result
        (ours_s, found), (grid_s, dips) = spans[screen], spans[plain]
        minima = sum(len(stay.minima_s) for stay in found.approaches)
        print(f"  {name:<12}{ours_s:>9.2f}{minima:>8,}{grid_s:>15.2f}{dips:>8,}{ours_s / grid_s:>8.2f}")


def pairs(n_objects=300, days=1.0, repeats=3):
    """Print the best seconds of one against `n_objects` and of all pairs among them, and the ratio of the two."""
    start_utc = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
    span = start_utc, days * units.DAY_S, WITHIN_M
    print(f"\npairs among {n_objects:,} objects for {days:g} days, within {WITHIN_M / units.KM:g} km")
    print(f"  {'catalogue':<12}{'1 to all, s':>12}{'found':>8}{'all pairs, s':>15}{'found':>8}{'ratio':>8}")
    for name, made in (("real", real(n_objects)), ("synthetic", synthetic(n_objects))):
        if made is None:
            print(f"  {name:<12}  RSO_LIDAR_SHARED names no catalogue")
            continue
        follower, objects = made
        best = {}
        for _ in range(repeats):
            for way, asked in ((screen, (follower, objects)), (screen_pairs, (objects,))):
                began = time.perf_counter()
                result = way(*asked, *span)
                seconds, _ = best.get(way, (np.inf, None))
                best[way] = min(seconds, time.perf_counter() - began), len(result.approaches)
        (one_s, one), (all_s, every) = best[screen], best[screen_pairs]
        print(f"  {name:<12}{one_s:>12.2f}{one:>8,}{all_s:>15.2f}{every:>8,}{all_s / one_s:>8.1f}")
