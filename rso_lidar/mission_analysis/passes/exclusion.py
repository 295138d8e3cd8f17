"""Constraints of a pass: exclusion angles about Sun, Moon and Earth, keep-out radius and corridors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.orbit import (
    Epochs,
    PairScreening,
    ScreeningResult,
    angle_rad,
    earth_limb_angle_rad,
    gcrs_from_teme,
    moon_position_m,
    shadow_margins_rad,
    sun_position_m,
)
from rso_lidar.pose import rotate_vectors
from rso_lidar.scenario import Constraints, Corridor

TOGETHER_M = 1e-3  # docked craft that share elements; there is no line of sight
_SKY_STEP_S = 600.0  # step of Sun and Moon; linear interpolation between is good to 1e-6 rad


def select_rtn_corridors(constraints: Constraints | None) -> list[Corridor]:
    """Select the corridors that apply to element sets: those in the rtn axes of their target."""
    return [corridor for corridor in constraints.corridor if corridor.axes == "rtn"] if constraints else []


def keep_out_radius_m(constraints: Constraints | None) -> float | None:
    """Return the radius [m] of the keep-out sphere about each object: the largest of several."""
    radius_m = constraints.keep_out_m if constraints else None
    return max(radius_m.values(), default=None) if isinstance(radius_m, dict) else radius_m


def check_constraints(
    asked: Constraints | None, table: dict[str, np.ndarray], place_m: np.ndarray
) -> dict[str, list[Any]]:
    """Return whether (row) each constraint is kept at the closest approach, and the angle [deg] off a corridor's axis.

    The worst of several corridors that apply counts.

    Parameters
    ----------
    table : columns (row) of the encounters by name
    place_m : (row, 3) position of the follower in the rtn axes of each object [m]
    """
    count = len(place_m)
    sun_deg, moon_deg, earth_deg, radius_m = (None,) * 4
    if asked is not None:
        sun_deg, moon_deg, earth_deg = asked.sun_exclusion_deg, asked.moon_exclusion_deg, asked.earth_exclusion_deg
        radius_m = keep_out_radius_m(asked)
    corridors = select_rtn_corridors(asked)
    unseen = table["follower_sunlit_fraction"] <= 0.0
    together = table["range_m"] < TOGETHER_M

    def check_limit(limit: float | None, kept: np.ndarray, applies: np.ndarray) -> list[bool | None]:
        return [
            bool(is_kept) if limit is not None and there else None for is_kept, there in zip(kept, applies, strict=True)
        ]

    angle_deg, inside, applies, within = (np.full(count, value) for value in (math.nan, True, False, False))
    worst = np.full(count, -math.inf)
    for corridor in corridors:
        angle = corridor.angle_rad(place_m) / units.DEG
        here = corridor.applies(place_m) & ~together
        over = np.where(here, angle - corridor.half_angle_deg, -1e3 - angle)
        angle_deg, worst = np.where(over > worst, angle, angle_deg), np.maximum(over, worst)
        inside, applies = inside & ~(here & (over > 0.0)), applies | here
        within |= corridor.margin_m(place_m) >= 0.0
    angle_deg[together] = math.nan
    return {
        "sun_kept": check_limit(sun_deg, unseen | (table["sun_angle_deg"] >= (sun_deg or 0.0)), ~together),
        "moon_kept": check_limit(moon_deg, table["moon_angle_deg"] >= (moon_deg or 0.0), ~together),
        "earth_kept": check_limit(earth_deg, table["earth_limb_deg"] >= (earth_deg or 0.0), ~together),
        "keep_out_kept": check_limit(radius_m, within | (table["range_m"] >= (radius_m or 0.0)), np.full(count, True)),
        "corridor_kept": check_limit(0.0, inside, applies),
        "corridor_angle_deg": angle_deg.tolist() if corridors else [None] * count,
    }


class ExclusionAngles:
    """Exclusion angles about Sun, Moon and Earth over the span of a screening, in TEME axes."""

    def __init__(self, screened: ScreeningResult | PairScreening, constraints: Constraints | None) -> None:
        self.constraints = constraints
        last_s = max((stay.leave_s for stay in screened.approaches), default=0.0)
        self._time_s = np.arange(0.0, last_s + 2.0 * _SKY_STEP_S, _SKY_STEP_S)
        epochs = Epochs(screened.objects.start_utc, self._time_s)
        teme_from_gcrs = np.swapaxes(gcrs_from_teme(epochs), -1, -2)
        self._sun_m = rotate_vectors(teme_from_gcrs, sun_position_m(epochs))
        self._moon_m = rotate_vectors(teme_from_gcrs, moon_position_m(epochs))

    def compute_excess_rad(self, time_s: np.ndarray, line: np.ndarray, position_m: np.ndarray) -> np.ndarray:
        """Return the excess (stay, instant) [rad] of the worst violated exclusion angle; 0 or less where all are kept.

        Parameters
        ----------
        time_s : (stay, instant) times [s since the start]
        line, position_m : (stay, instant, 3) vectors from the follower to the object, and positions of the follower [m], in
            TEME axes
        """
        asked, worst = self.constraints, np.full(time_s.shape, -np.pi)
        if asked is None:
            return worst
        if asked.sun_exclusion_deg is not None:
            sun_m = self.sun_position_m(time_s)
            near = asked.sun_exclusion_deg * units.DEG - angle_rad(line, sun_m - position_m)
            worst = np.minimum(near, shadow_margins_rad(position_m, sun_m)[1])  # the Sun is invisible in the umbra
        if asked.moon_exclusion_deg is not None:
            moon_m = self._at(self._moon_m, time_s)
            near = asked.moon_exclusion_deg * units.DEG - angle_rad(line, moon_m - position_m)
            worst = np.maximum(worst, near)
        if asked.earth_exclusion_deg is not None:
            near = asked.earth_exclusion_deg * units.DEG - earth_limb_angle_rad(line, position_m)
            worst = np.maximum(worst, near)
        return worst

    def sun_position_m(self, time_s: np.ndarray) -> np.ndarray:
        """Return the position (…, 3) of the Sun in TEME axes at some times (…) [m]."""
        return self._at(self._sun_m, time_s)

    def _at(self, vectors: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(time_s, self._time_s, column) for column in vectors.T], axis=-1)
