"""A file of the IERS with the numbers of a textbook, and an orbit that passes over stations."""

import datetime

from rso_lidar.orbit import Kepler

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
LOW = Kepler(
    epoch_utc=START, semi_major_axis_km=6878.137, eccentricity=0.001, inclination_deg=97.4, raan_deg=40.0,
    argument_of_perigee_deg=15.0, true_anomaly_deg=30.0,
)  # fmt: skip
GEO = Kepler(
    epoch_utc=START, semi_major_axis_km=42164.0, eccentricity=0.0, inclination_deg=0.1, raan_deg=0.0,
    argument_of_perigee_deg=0.0, true_anomaly_deg=200.0,
)  # fmt: skip


def finals(days, x, y, ut1_minus_utc_s):
    """Return lines in the columns of finals2000A.all, the same numbers on every day."""
    return "".join(
        f"{'':7}{day:8.2f} I {x:9.6f}{0.0:9.6f} {y:9.6f}{0.0:9.6f}  I{ut1_minus_utc_s:10.7f}{0.0:10.7f}\n"
        for day in days
    )
