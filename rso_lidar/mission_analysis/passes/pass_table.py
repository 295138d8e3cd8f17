"""The table of encounters, as text and as CSV."""

from __future__ import annotations

import datetime
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rso_lidar import units
from rso_lidar.files import align_columns, format_csv, write_text
from rso_lidar.mission_analysis.passes.encounter_figure import encounter_figure
from rso_lidar.mission_analysis.passes.exclusion import keep_out_radius_m, select_rtn_corridors
from rso_lidar.mission_analysis.passes.pass_collision import PassCollision
from rso_lidar.mission_analysis.passes.pass_geometry import (
    SMALL_M2,
    Encounter,
    reach_m,
)
from rso_lidar.mission_analysis.passes.plate_light import PlateLight
from rso_lidar.scenario import Constraints, Lidar
from rso_lidar.units import format_count

NOTE = (
    "Element sets are good to about a kilometre, and worse with age: these are plausible encounters, not predictions."
)


_CERTAIN = 0.995  # probability from which two decimals show 1
_REASONS = 4  # why probabilities are missing that are printed


@dataclass(frozen=True, eq=False)
class Encounters:
    """The encounters of one follower, or of any two objects, sorted.

    `follower` is its element set nearest to the start, or its trajectory; None where all pairs were searched. `rejected`
    lists objects that were not propagated to the end, with the reason. `switching` counts objects that change to another
    element set within the span. `has_collisions` states whether the probability of collision was asked for. `TEXT_HEADS`
    are the heads of columns of text, which align to the left, and `MAX_SLEW_DEG_S` is the limit of the rate of the line of
    sight where none is given.
    """

    MAX_SLEW_DEG_S: ClassVar[float] = 2.0
    TEXT_HEADS: ClassVar[tuple[str, ...]] = (
        *("follower", "object", "closest approach, UTC", "breaks"),
        *("by", "follower's covariance", "covariance"),
    )

    rows: tuple[Encounter, ...]
    follower: Any
    lidar: Lidar
    lidar_name: str
    start_utc: datetime.datetime
    days: float
    within_m: float
    max_slew_deg_s: float
    reach_m: tuple[float, float]
    screened: int
    rejected: tuple[tuple[str, str], ...]
    constraints: Constraints | None = None
    switching: int = 0
    light: PlateLight | None = None
    has_collisions: bool = False

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def title(self) -> str:
        """One line that describes the search."""
        among = format_count(self.screened, "object")
        who = f"any two of {among}" if self.follower is None else self.follower.label
        of = "" if self.follower is None else f" of {among}"
        return (
            f"{who} within {self.within_m / units.KM:g} km{of}, "
            f"{self.start_utc.astimezone(datetime.UTC):%Y-%m-%dT%H:%M:%SZ} + {self.span}"
        )

    @property
    def span(self) -> str:
        """Length of the searched span in words."""
        return format_count(self.days, "day")

    def cells(self) -> tuple[list[str], list[list[str]]]:
        """Return the heads and rows of the text table; `csv` has more columns."""
        heads = [
            "#",
            *(["follower"] if self.follower is None else []),
            "object",
            "norad",
            "closest approach, UTC",
            "range, km",
            "speed, m/s",
            "inside, s",
        ]
        heads += ["Pc"] if self.has_collisions else []
        heads += ["lidar, s", "slew, deg/s", *(["clear, s"] if self._excludes else []), "usable, s"]
        heads += ["photons", "pixels", *([] if self._is_always_found else ["found"])]
        heads += ["phase, deg", "Moon, deg", "limb, deg", "light", "age, d"]
        heads += ["breaks"] if self.constraints is not None else []
        return heads, [self._shown(number, row) for number, row in enumerate(self.rows, start=1)]

    def _shown(self, number: int, row: Encounter) -> list[str]:
        light = "Sun" if row.sunlit_fraction >= 0.99 else "dark" if row.sunlit_fraction <= 0.01 else "part"
        minima = f" ({row.minima} minima)" if row.minima > 1 else ""
        minima = " (docked or one object)" if row.docked else minima
        return [
            str(number),
            *([row.follower_label] if self.follower is None else []),
            row.label + minima,
            str(row.norad_id or "-"),
            f"{row.closest_utc[:19]}Z",  # CSV and JSON have the milliseconds
            f"{row.range_m / units.KM:,.3f}",
            f"{row.speed_m_s:,.1f}",
            ("" if row.entered and row.left else ">") + f"{row.inside_s:,.1f}",
            *([_format_collision(row.collision)] if self.has_collisions else []),
            _format_seconds(row.lidar_s),
            f"{row.slew_deg_s:,.3f}",
            *([_format_seconds(row.clear_s)] if self._excludes else []),
            _format_seconds(row.usable_s),
            _format_three(row.photons),
            _format_three(row.target_pixels),
            *([] if self._is_always_found else [_format_probability(row.found_probability)]),
            _format_degrees(row.phase_deg),
            _format_degrees(row.moon_angle_deg),
            _format_degrees(row.earth_limb_deg),
            light,
            "-" if math.isnan(row.age_days) else f"{round(row.age_days, 1) + 0.0:.1f}",  # no -0.0
            *([", ".join(row.breaks) or "-"] if self.constraints is not None else []),
        ]

    def collision_cells(self) -> tuple[list[str], list[list[str]]]:
        """Return the heads and rows of the table of what was used for each probability of collision that is known."""
        heads = ["#", "Pc", "by", "Foster", "3-D", "sigma, m", "Mahalanobis", "greatest Pc", "radius, m", "object"]
        heads += ["sigma R, m", "sigma T, m", "sigma N, m", "window, s", "follower's covariance", "covariance"]
        rows = []
        for number, row in enumerate(self.rows, start=1):
            used = row.collision
            if used is None or not used.is_known:
                continue
            sigmas = (used.sigma_radial_m, used.sigma_along_m, used.sigma_cross_m)
            rows.append(
                [
                    str(number),
                    f"{used.collision_probability:.2e}",
                    used.collision_method + ("*" if used.differs else ""),
                    _format_tiny(used.foster_probability),
                    _format_tiny(used.integral_probability),
                    f"{used.miss_sigma_m:,.0f}",
                    "-" if math.isnan(used.mahalanobis) else f"{used.mahalanobis:.2f}",
                    _format_tiny(used.greatest_probability) if used.is_diluted else "-",
                    f"{used.hard_body_radius_m:g}",
                    row.label,
                    *(f"{sigma_m:,.0f}" for sigma_m in sigmas),
                    "-" if math.isnan(used.integral_window_s) else f"{used.integral_window_s:,.3g}",
                    used.follower_covariance,
                    used.covariance,
                ]
            )
        return heads, rows

    def collision_notes(self) -> list[str]:
        """Return the notes about probabilities of collision: what they are, their sum, and what is missing."""
        if not self.has_collisions:
            return []
        rows = [(row, row.collision) for row in self.rows if row.collision is not None]
        known = [used for _, used in rows if used.is_known]
        lines = []
        if known:
            origins = sorted({used.hard_body_source for used in known})
            more = f", and {len(origins) - 3} more" if len(origins) > 3 else ""
            lines.append(f"Pc: probability of collision; combined hard-body radius: {'; '.join(origins[:3])}{more}")
            lines.append(
                "by: Foster where the encounter takes at most 2 % of a revolution and no integral in 3-D differs by over 2 %"
                + ("; *: they differ" if any(used.differs for used in known) else "")
            )
            lines.append(
                "sigma: of the relative position along the line of sight, R, T and N: in the follower's rtn axes"
            )
        if any(used.is_diluted for used in known):
            lines.append(
                "greatest Pc: over all sizes of the covariance, where it is diluted: better orbits could raise it"
            )
        if any("own sets" in used.covariance + used.follower_covariance for used in known):
            lines.append(
                "covariances of element sets are differences of their own sets by age: consistency, not accuracy, with the "
                "errors of both sets"
            )
        if len(known) > 1:
            total = sum(used.collision_probability for used in known)
            lines.append(
                f"expected collisions of all {len(known)} passes: {total:.2e}, an upper bound of the probability of any; "
                "windows of neighbouring slow passes may overlap, and count twice then"
            )
        reasons: dict[str, list[str]] = {}
        for row, used in rows:
            if not used.is_known:
                reasons.setdefault(used.collision_reason, []).append(row.label)
        for reason, labels in list(reasons.items())[:_REASONS]:
            several = list(dict.fromkeys(labels))
            shown = ", ".join(several[:3]) + (f" and {len(several) - 3} more" if len(several) > 3 else "")
            lines.append(f"Pc -: {shown}: {reason}")
        if len(reasons) > _REASONS:
            lines.append(f"Pc -: {len(reasons) - _REASONS} more reasons in the CSV file, column collision_reason")
        return lines

    @property
    def _is_always_found(self) -> bool:
        """Whether every row that can be looked at is found with certainty, so that a note says it instead of a column."""
        known = [row.found_probability for row in self.rows if not math.isnan(row.found_probability)]
        return bool(known) and min(known) >= _CERTAIN

    @property
    def _excludes(self) -> list[str]:
        """Descriptions of the exclusion angles."""
        asked = self.constraints
        if asked is None:
            return []
        angles = (
            ("Sun {:g} deg while any of it is seen", asked.sun_exclusion_deg),
            ("Moon {:g} deg", asked.moon_exclusion_deg),
            ("Earth's limb {:g} deg", asked.earth_exclusion_deg),
        )
        return [text.format(angle) for text, angle in angles if angle is not None]

    def notes(self) -> list[str]:
        """Return the notes below the table."""
        limits = f"usable: in reach, and the line of sight turns at most {self.max_slew_deg_s:g} deg/s"
        small_m = reach_m(self.lidar, SMALL_M2)[1]
        lines = [
            f"lidar {self.lidar_name}: reaches {self.reach_m[0]:,.0f} to {self.reach_m[1]:,.0f} m (a facing plate of 1 m2, "
            f"reflectance 0.30); {limits}{', and clear' if self._excludes else ''}",
            f"in reach and usable are those of 1 m2, whatever the object is: a plate of {SMALL_M2:g} m2, as a side of a "
            f"CubeSat, is seen to {small_m:,.0f} m only",
            *([] if self.light is None else self.light.describe()),
            *(
                [f"found: {_CERTAIN:g} or more in every row, so that it has no column here"]
                if self._is_always_found
                else []
            ),
            *self._describe_constraints(),
            *(["the lidar is on the object named first, the follower of the pair"] if self.follower is None else []),
            *self._describe_accuracy(),
        ]
        lines += self.collision_notes()
        lines += self._explain_docked()
        if self.switching:
            several = format_count(self.switching, "object")
            lines.append(
                f"{several} with more than one element set in this span, the follower counted: at each instant the set "
                "nearest in epoch flies, and where sets switch the range jumps"
            )
        if self.rejected:
            first = "; ".join(f"{label}: {why}" for label, why in self.rejected[:3])
            more = f"; and {len(self.rejected) - 3} more" if len(self.rejected) > 3 else ""
            several = format_count(len({label for label, _ in self.rejected}), "object")
            lines.append(f"{several} not flown, or not to the end: {first}{more}")
        return lines

    @property
    def has_element_sets(self) -> bool:
        """Whether some row has the error of an element set, or there is no row."""
        ages = [(row.age_days, row.follower_age_days) for row in self.rows]
        return not ages or not all(math.isnan(age_days) and math.isnan(other) for age_days, other in ages)

    def _describe_accuracy(self) -> list[str]:
        """Describe how good the objects' motions are."""
        lines = [NOTE] if self.has_element_sets else []
        if any(math.isnan(row.age_days) or math.isnan(row.follower_age_days) for row in self.rows):
            lines.append("a trajectory is as good as what it came from")
        return lines

    def _explain_docked(self) -> list[str]:
        """Explain why objects count as docked with the follower, in one line for each reason."""
        reasons: dict[str, list[str]] = {}
        for row in self.rows:
            if row.docked:
                whom = f"{row.follower_label} and {row.label}" if self.follower is None else row.label
                reasons.setdefault(row.docked, []).append(whom)
        return [
            f"docked or one object: {', '.join(labels)}: {reason}; no encounter, and no scenario is written"
            for reason, labels in reasons.items()
        ]

    def _describe_constraints(self) -> list[str]:
        """Describe how the constraints were applied."""
        asked = self.constraints
        if asked is None:
            return []
        lines = []
        if self._excludes:
            lines.append(f"clear: a boresight at the object keeps off {', '.join(self._excludes)}")
        radius_m, known = keep_out_radius_m(asked), select_rtn_corridors(asked)
        if radius_m is not None:
            named = f", the largest of {', '.join(asked.keep_out_m)}" if isinstance(asked.keep_out_m, dict) else ""
            outside = ", but in a corridor" if known else ""
            lines.append(f"keep-out: {radius_m:g} m about each object{named}{outside}, at the closest approach")
        for k, corridor in enumerate(asked.corridor):
            if corridor in known:
                far = f" to {corridor.to_m:g} m" if corridor.to_m else ""
                axis = ", ".join(f"{part:g}" for part in corridor.axis)
                lines.append(
                    f"corridor[{k}]: {corridor.half_angle_deg:g} deg about [{axis}] in the rtn axes of each object, from "
                    f"{corridor.from_m:g} m{far}, at the closest approach"
                )
            else:
                lines.append(
                    f"corridor[{k}]: not applicable: it turns with {corridor.axes or corridor.target}, and element sets "
                    'tell no attitude; give it in axes "rtn"'
                )
        return lines

    def table(self) -> str:
        """Return the table as plain text, with its title and notes."""
        if not self.rows:
            return "\n".join([self.title, "no encounter found", *self.notes()])
        heads, body = self.cells()
        lines = align_columns([heads, *body], [k for k, head in enumerate(heads) if head in self.TEXT_HEADS])
        heads, body = self.collision_cells()
        if body:
            left = [k for k, head in enumerate(heads) if head in self.TEXT_HEADS]
            lines += ["", "what was used for Pc", *align_columns([heads, *body], left), ""]
        return "\n".join([self.title, *lines, *self.notes()])

    def figure(self) -> Any:
        """Return the figure of ranges over time, coloured by relative speed; docked pairs are left out."""
        rows = [row for row in self.rows if not row.docked]
        start = np.datetime64(self.start_utc.astimezone(datetime.UTC).replace(tzinfo=None), "ms")
        return encounter_figure(
            start + np.array([round(1e3 * row.time_s) for row in rows]).astype("timedelta64[ms]"),
            np.array([row.range_m for row in rows]),
            np.array([row.speed_m_s for row in rows]),
            np.array([row.sunlit_fraction >= 0.5 for row in rows]),
            [
                (row.label if self.follower else f"{row.follower_label}, {row.label}") + _format_name_end(row.collision)
                for row in rows
            ],
            self.within_m,
            self.reach_m[1],
            f"Encounters of {(self.follower.name or self.follower.label) if self.follower else 'all pairs'}",
            f"{format_count(len(rows), 'encounter')} within {self.within_m / units.KM:g} km of "
            f"{format_count(self.screened, 'object')}   ·   "
            f"{self.start_utc:%Y-%m-%d %H:%M} UTC + {self.span}"
            + ("   ·   element sets are good to a kilometre" if self.has_element_sets else ""),
            window_utc=(start, start + np.timedelta64(round(units.DAY_S * 1e3 * self.days), "ms")),
        )

    def csv(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write all rows and columns as CSV; names of columns end in their unit.

        Parameters
        ----------
        path : of the file
        overwrite : whether an existing file may be replaced

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            If the file exists or cannot be written there.
        """
        rows = [[_format_cell(name, value) for name, value in self._list_values(row).items()] for row in self.rows]
        return write_text(path, format_csv([self._columns(), *rows]), overwrite=overwrite)

    def json(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write all rows and columns as JSON, with the search and its notes; what is not known is null.

        Parameters
        ----------
        path : of the file
        overwrite : whether an existing file may be replaced

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            If the file exists or cannot be written there.
        """
        tree = {
            "title": self.title,
            "start_utc": f"{self.start_utc.astimezone(datetime.UTC):%Y-%m-%dT%H:%M:%SZ}",
            "days": self.days,
            "within_m": self.within_m,
            "lidar": self.lidar_name,
            "encounters": [
                {name: _clean(value) for name, value in self._list_values(row).items()} for row in self.rows
            ],
            "rejected": [list(entry) for entry in self.rejected],
            "notes": self.notes(),
        }
        return write_text(path, json.dumps(tree, indent=1, ensure_ascii=False) + "\n", overwrite=overwrite)

    def _columns(self) -> list[str]:
        return Encounter.columns() + (PassCollision.columns() if self.has_collisions else [])

    def _list_values(self, row: Encounter) -> dict[str, Any]:
        """Return the values of a row by the names of their columns."""
        used = row.collision or PassCollision()
        collision = PassCollision.columns()
        return {name: getattr(used if name in collision else row, name) for name in self._columns()}


def _format_collision(used: PassCollision | None) -> str:
    return "-" if used is None or not used.is_known else f"{used.collision_probability:.1e}"


def _format_name_end(used: PassCollision | None) -> str:
    """Return what the picture adds to a name: its probability of collision."""
    return "" if used is None or not used.is_known else f", Pc {used.collision_probability:.1e}"


def _format_tiny(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2e}"


def _clean(value: Any) -> Any:
    """Return a value for JSON, which has no NaN."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _format_seconds(time_s: float) -> str:
    return "-" if math.isnan(time_s) else f"{time_s:,.1f}"


def _format_probability(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"


def _format_three(value: float) -> str:
    """Format a number with three digits, or as a whole number if it is large."""
    return "-" if math.isnan(value) else f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"


def _format_degrees(angle: float) -> str:
    return "-" if math.isnan(angle) else str(round(angle))


def _format_cell(name: str, value: Any) -> Any:
    if name.endswith("norad_id") and not value:
        return ""  # a trajectory has no catalogue number
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.9g}" if isinstance(value, float) else value
