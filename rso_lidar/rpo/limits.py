"""Limits of plans about a body that orbits the Earth: how long, how fast, how far, and in how many pieces.

Numbers outside them are typing errors: a plan of such numbers would have no meaning, or take very long to compute.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Count, NotNegative, Number, Positive, Vector

LONGEST_S = 10.0 * 365.25 * units.DAY_S
FASTEST_M_S = 25_000.0  # twice the escape speed at the Earth's surface is 22.4 km/s: no two bodies pass faster
MOST_PIECES = 1000  # legs of one plan


def _check_duration(duration_s: float) -> float:
    if duration_s > LONGEST_S:
        raise ValueError(
            f"{format_years(duration_s)} years are too long: plans are for up to {format_years(LONGEST_S)}; "
            f"give at most {LONGEST_S:g} s"
        )
    return duration_s


def _check_transfer_time(duration_s: float) -> float:
    if duration_s <= 0.0:
        what = "needs infinite speed" if duration_s == 0.0 else "is negative"
        raise ValueError(f"a transfer in {duration_s:g} s {what}; give more than zero")
    return duration_s


def _check_speed(velocity_m_s: Vector) -> Vector:
    speed_m_s = math.hypot(*velocity_m_s)
    if speed_m_s > FASTEST_M_S:
        raise ValueError(
            f"{speed_m_s:g} m/s is faster than bodies pass each other near the Earth; give at most {FASTEST_M_S:g} m/s"
        )
    return velocity_m_s


def _check_count(count: int) -> int:
    if count > MOST_PIECES:
        raise ValueError(f"a plan has at most {MOST_PIECES} of them; give fewer")
    return count


Duration = Annotated[Positive, AfterValidator(_check_duration)]
Wait = Annotated[NotNegative, AfterValidator(_check_duration)]
TransferTime = Annotated[Number, AfterValidator(_check_transfer_time), AfterValidator(_check_duration)]
Velocity = Annotated[Vector, AfterValidator(_check_speed)]
Pieces = Annotated[Count, AfterValidator(_check_count)]


def format_years(duration_s: float) -> str:
    """Format a time in years."""
    return f"{duration_s / (365.25 * units.DAY_S):.3g}"


def check_horizon(horizon_s: Any) -> float:
    """Return a horizon [s]; raise `ScenarioError` unless it is positive and not longer than `LONGEST_S`."""
    if (
        isinstance(horizon_s, bool)
        or not isinstance(horizon_s, int | float | np.number)
        or not 0.0 < horizon_s <= LONGEST_S
    ):
        raise ScenarioError(
            f"horizon_s: {horizon_s!r:.40} is not a valid duration of a drift; give seconds above zero, up to {LONGEST_S:g}"
        )
    return float(horizon_s)
