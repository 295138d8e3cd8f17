"""What no plan about a body that orbits the Earth is beyond: how long, how fast, how far and in how many pieces.

Numbers outside are slips of the pen: a plan of them would mean nothing, or take for ever to work out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Count, NotNegative, Number, Positive, Vector

if TYPE_CHECKING:
    from rso_lidar.rpo.plan import Plan

LONGEST_S = 10.0 * 365.25 * units.DAY_S
FASTEST_M_S = 25_000.0  # twice the escape speed at the Earth's surface is 22.4 km/s: nothing passes faster there
MOST_PIECES = 1000  # legs of one plan
_LOOKS = 5  # at a leg, for how far and how fast it goes
# What says how fast a plan is flown, most telling first
_PACE = ("times_s", "duration_s", "speed_m_s", "hops", "rate_deg_s", "period_s", "loops", "radial_m", "position_m")


def _in_a_life(duration_s: float) -> float:
    if duration_s > LONGEST_S:
        raise ValueError(
            f"{_years(duration_s)} years are too long: plans are for up to {_years(LONGEST_S)}; give at most {LONGEST_S:g} s"
        )
    return duration_s


def _takes_time(duration_s: float) -> float:
    if duration_s <= 0.0:
        what = "needs infinite speed" if duration_s == 0.0 else "goes back in time"
        raise ValueError(f"a transfer in {duration_s:g} s {what}: give more than zero")
    return duration_s


def _slow_enough(velocity_m_s: Vector) -> Vector:
    speed_m_s = math.hypot(*velocity_m_s)
    if speed_m_s > FASTEST_M_S:
        raise ValueError(
            f"{speed_m_s:g} m/s is faster than bodies pass each other near the Earth; give at most {FASTEST_M_S:g} m/s"
        )
    return velocity_m_s


def _few(count: int) -> int:
    if count > MOST_PIECES:
        raise ValueError(f"a plan has at most {MOST_PIECES} of them; give fewer")
    return count


Duration = Annotated[Positive, AfterValidator(_in_a_life)]
Wait = Annotated[NotNegative, AfterValidator(_in_a_life)]
TransferTime = Annotated[Number, AfterValidator(_takes_time), AfterValidator(_in_a_life)]
Velocity = Annotated[Vector, AfterValidator(_slow_enough)]
Pieces = Annotated[Count, AfterValidator(_few)]


def _years(duration_s: float) -> str:
    return f"{duration_s / (365.25 * units.DAY_S):.3g}"


def horizon_within(horizon_s: Any) -> float:
    """Return a horizon [s] as it is; `ScenarioError` where it is no time, or too long."""
    if (
        isinstance(horizon_s, bool)
        or not isinstance(horizon_s, int | float | np.number)
        or not 0.0 < horizon_s <= LONGEST_S
    ):
        raise ScenarioError(
            f"horizon_s: {horizon_s!r:.40} is no time to follow a drift for: give seconds above zero, up to {LONGEST_S:g}"
        )
    return float(horizon_s)


def places_within(operation: Any, mean_motion_rad_s: float) -> None:
    """Refuse lengths of an operation beyond the radius of the body's orbit, where its rtn axes mean nothing."""
    radius_m = float(np.cbrt(units.EARTH_GM_M3_S2 / mean_motion_rad_s**2))
    for name in type(operation).model_fields:
        if not name.endswith("_m") or name == "keep_out_m" or getattr(operation, name) is None:
            continue
        rows = np.array(getattr(operation, name), dtype=float)
        sizes_m = np.abs(rows) if rows.ndim == 0 else np.sqrt(np.sum(rows * rows, axis=-1))
        if np.any(sizes_m > radius_m):
            at = f"{name}[{int(np.argmax(sizes_m > radius_m))}]" if rows.ndim == 2 else name
            raise ScenarioError(
                f"{at}: {float(sizes_m.max()) / units.KM:.4g} km is farther than the body is from the Earth's centre, "
                f"{radius_m / units.KM:.0f} km, and Clohessy-Wiltshire means nothing there: come nearer, or use lambert"
            )


def plan_within(plan: Plan, operation: Any, *, far: bool = False) -> Plan:
    """Return the plan itself; `ScenarioError`, naming the key that sets its pace, where it is too long, fast or far."""
    given = type(operation).model_fields
    key = next((name for name in _PACE if name in given and getattr(operation, name) is not None), plan.name)
    if not plan.duration_s <= LONGEST_S:
        raise ScenarioError(
            f"{key}: the plan takes {_years(plan.duration_s)} years, and plans are for up to {_years(LONGEST_S)}: "
            "fly it in less"
        )
    speeds_m_s, places_m = [impulse.size_m_s for impulse in plan.impulses], [0.0]
    for leg, begin_s, end_s in plan.stretches():
        position, velocity = leg.path(np.linspace(0.0, end_s - begin_s, _LOOKS))
        speeds_m_s.append(float(np.sqrt(np.sum(velocity * velocity, axis=1).max())))
        places_m.append(float(np.sqrt(np.sum(position * position, axis=1).max())))
    if not max(speeds_m_s) <= FASTEST_M_S:
        raise ScenarioError(
            f"{key}: the plan needs {max(speeds_m_s):.3g} m/s, faster than bodies pass each other near the Earth, at most "
            f"{FASTEST_M_S:g} m/s: take longer, or go less far"
        )
    radius_m = float(np.cbrt(units.EARTH_GM_M3_S2 / plan.mean_motion_rad_s**2))
    if not far and not max(places_m) <= radius_m:
        raise ScenarioError(
            f"{key}: the plan leads {max(places_m) / units.KM:.4g} km away, farther than the body is from the Earth's "
            f"centre, {radius_m / units.KM:.0f} km, and Clohessy-Wiltshire means nothing there: plan a shorter time, or use "
            "lambert"
        )
    return plan
