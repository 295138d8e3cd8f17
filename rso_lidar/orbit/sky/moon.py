"""The Moon's position, without an ephemeris file: Meeus, Astronomical Algorithms 2nd ed., ch. 47 (after ELP-2000/82).

It is within 18 arcseconds and 32 km of ELP/MPP02 from 1950 to 2100, 3 arcseconds and 6 km rms. These figures are from the
notes to ERFA's moon98, the same series, which this module equals within 0.9 arcsecond. The ecliptic and equinox of date are
rotated to GCRS by the IAU 1976 precession. As in Meeus, the longitude contains the light time of 1.3 s: it is the apparent
Moon.
"""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.precession import gcrs_from_mean_of_date

# Meeus, tables 47.A and 47.B: multiples of D, M, M', F; sine terms of longitude [1e-6 deg], cosine terms of distance [m]
_LONGITUDE_DISTANCE = """
0 0 1 0 6288774 -20905355|2 0 -1 0 1274027 -3699111|2 0 0 0 658314 -2955968|0 0 2 0 213618 -569925|0 1 0 0 -185116 48888
0 0 0 2 -114332 -3149|2 0 -2 0 58793 246158|2 -1 -1 0 57066 -152138|2 0 1 0 53322 -170733|2 -1 0 0 45758 -204586
0 1 -1 0 -40923 -129620|1 0 0 0 -34720 108743|0 1 1 0 -30383 104755|2 0 0 -2 15327 10321|0 0 1 2 -12528 0
0 0 1 -2 10980 79661|4 0 -1 0 10675 -34782|0 0 3 0 10034 -23210|4 0 -2 0 8548 -21636|2 1 -1 0 -7888 24208
2 1 0 0 -6766 30824|1 0 -1 0 -5163 -8379|1 1 0 0 4987 -16675|2 -1 1 0 4036 -12831|2 0 2 0 3994 -10445
4 0 0 0 3861 -11650|2 0 -3 0 3665 14403|0 1 -2 0 -2689 -7003|2 0 -1 2 -2602 0|2 -1 -2 0 2390 10056
1 0 1 0 -2348 6322|2 -2 0 0 2236 -9884|0 1 2 0 -2120 5751|0 2 0 0 -2069 0|2 -2 -1 0 2048 -4950
2 0 1 -2 -1773 4130|2 0 0 2 -1595 0|4 -1 -1 0 1215 -3958|0 0 2 2 -1110 0|3 0 -1 0 -892 3258
2 1 1 0 -810 2616|4 -1 -2 0 759 -1897|0 2 -1 0 -713 -2117|2 2 -1 0 -700 2354|2 1 -2 0 691 0
2 -1 0 -2 596 0|4 0 1 0 549 -1423|0 0 4 0 537 -1117|4 -1 0 0 520 -1571|1 0 -2 0 -487 -1739
2 1 0 -2 -399 0|0 0 2 -2 -381 -4421|1 1 1 0 351 0|3 0 -2 0 -340 0|4 0 -3 0 330 0
2 -1 2 0 327 0|0 2 1 0 -323 1165|1 1 -1 0 299 0|2 0 3 0 294 0|2 0 -1 -2 0 8752
"""
_LATITUDE = """
0 0 0 1 5128122|0 0 1 1 280602|0 0 1 -1 277693|2 0 0 -1 173237|2 0 -1 1 55413|2 0 -1 -1 46271|2 0 0 1 32573|0 0 2 1 17198
2 0 1 -1 9266|0 0 2 -1 8822|2 -1 0 -1 8216|2 0 -2 -1 4324|2 0 1 1 4200|2 1 0 -1 -3359|2 -1 -1 1 2463|2 -1 0 1 2211
2 -1 -1 -1 2065|0 1 -1 -1 -1870|4 0 -1 -1 1828|0 1 0 1 -1794|0 0 0 3 -1749|0 1 -1 1 -1565|1 0 0 1 -1491|0 1 1 1 -1475
0 1 1 -1 -1410|0 1 0 -1 -1344|1 0 0 -1 -1335|0 0 3 1 1107|4 0 0 -1 1021|4 0 -1 1 833|0 0 1 -3 777|4 0 -2 1 671
2 0 0 -3 607|2 0 2 -1 596|2 -1 1 -1 491|2 0 -2 1 -451|0 0 3 -1 439|2 0 2 1 422|2 0 -3 -1 421|2 1 -1 1 -366
2 1 0 1 -351|4 0 0 1 331|2 -1 1 1 315|2 -2 0 -1 302|0 0 1 3 -283|2 1 1 -1 -229|1 1 0 -1 223|1 1 0 1 223
0 1 -2 -1 -220|2 1 -1 -1 -220|1 0 1 1 -185|2 -1 -2 -1 181|0 1 2 1 -177|4 0 -2 -1 176|4 -1 -1 -1 166|1 0 1 -1 -164
4 0 1 -1 132|1 0 -1 -1 -119|4 -1 0 -1 115|2 -2 0 1 107
"""
_MICRO = 1e-6 * units.DEG
_BLOCK = 4096  # epochs at a time


def moon_position_m(epochs: Epochs) -> np.ndarray:
    """Return the apparent position (time, 3) [m] of the Moon from the Earth's centre, in GCRS axes.

    Parameters
    ----------
    epochs : instants
    """
    t = epochs.tt_centuries()
    parts = [_gcrs(t[k : k + _BLOCK]) for k in range(0, len(t), _BLOCK)] or [_gcrs(t)]
    return np.concatenate(parts)


def _gcrs(t: np.ndarray) -> np.ndarray:
    longitude, latitude, distance = ecliptic_of_date(t)
    obliquity = (23.439_291 - 0.013_004_2 * t) * units.DEG
    c = np.cos(latitude)
    x, y, z = c * np.cos(longitude), c * np.sin(longitude), np.sin(latitude)
    ce, se = np.cos(obliquity), np.sin(obliquity)
    of_date = distance[:, None] * np.stack([x, ce * y - se * z, se * y + ce * z], axis=-1)
    return gcrs_from_mean_of_date(of_date, t)


def ecliptic_of_date(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Evaluate the series of Meeus, ch. 47.

    Parameters
    ----------
    t : (time,) TT centuries since J2000.0

    Returns
    -------
    longitude, latitude, distance : (time,) [rad], [rad], [m] in the mean ecliptic and equinox of date
    """
    mean = _polynomial(t, 218.316_447_7, 481_267.881_234_21, -0.001_578_6, 1 / 538_841, -1 / 65_194_000)
    d = _polynomial(t, 297.850_192_1, 445_267.111_403_4, -0.001_881_9, 1 / 545_868, -1 / 113_065_000)
    m = _polynomial(t, 357.529_109_2, 35_999.050_290_9, -0.000_153_6, 1 / 24_490_000, 0.0)
    mp = _polynomial(t, 134.963_396_4, 477_198.867_505_5, 0.008_741_4, 1 / 69_699, -1 / 14_712_000)
    f = _polynomial(t, 93.272_095_0, 483_202.017_523_3, -0.003_653_9, -1 / 3_526_000, 1 / 863_310_000)
    venus, jupiter = (119.75 + 131.849 * t) * units.DEG, (53.09 + 479_264.290 * t) * units.DEG
    third = (313.45 + 481_266.484 * t) * units.DEG
    less = 1.0 - 0.002_516 * t - 0.000_007_4 * t * t  # terms in M shrink with the Earth's eccentricity
    by = (np.ones_like(t), less, less * less)
    longitude = 3958.0 * np.sin(venus) + 1962.0 * np.sin(mean - f) + 318.0 * np.sin(jupiter)
    latitude = (
        -2235.0 * np.sin(mean)
        + 382.0 * np.sin(third)
        + 175.0 * (np.sin(venus - f) + np.sin(venus + f))
        + 127.0 * np.sin(mean - mp)
        - 115.0 * np.sin(mean + mp)
    )
    distance = np.full_like(t, 385_000_560.0)
    for of_d, of_m, of_mp, of_f, sine, cosine in _parse_table(_LONGITUDE_DISTANCE):
        angle = of_d * d + of_m * m + of_mp * mp + of_f * f
        longitude += sine * by[abs(of_m)] * np.sin(angle)
        distance += cosine * by[abs(of_m)] * np.cos(angle)
    for of_d, of_m, of_mp, of_f, sine in _parse_table(_LATITUDE):
        latitude += sine * by[abs(of_m)] * np.sin(of_d * d + of_m * m + of_mp * mp + of_f * f)
    return mean + longitude * _MICRO, latitude * _MICRO, distance


def _polynomial(t: np.ndarray, *degrees: float) -> np.ndarray:
    total = np.zeros_like(t)
    for coefficient in reversed(degrees):
        total = total * t + coefficient
    angle: np.ndarray = np.fmod(total, 360.0) * units.DEG
    return angle


def _parse_table(table: str) -> list[list[int]]:
    return [[int(word) for word in row.split()] for line in table.split("\n") if line for row in line.split("|")]
