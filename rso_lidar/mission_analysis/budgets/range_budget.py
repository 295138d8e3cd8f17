"""The link budget of a pixel: light, detection and precision against range, in closed form; pixels on a target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rso_lidar import units
from rso_lidar.detector import false_alarm_probability
from rso_lidar.errors import ScenarioError
from rso_lidar.files import align_columns, check_writable, format_csv, write_text
from rso_lidar.mission_analysis.budgets.budget_figure import budget_figure
from rso_lidar.mission_analysis.budgets.inputs import (
    check_angles_deg,
    check_positive,
    check_probability,
    choose_materials,
    choose_ranges_m,
    choose_target,
    describe_omissions,
    has_retros,
    select_camera,
)
from rso_lidar.mission_analysis.budgets.range_curve import FARTHEST_M, BudgetCurve, compute_curve
from rso_lidar.picture import LIGHT, RESULT_SUFFIXES, Scheme, save_figure
from rso_lidar.scenario import Lidar, Scenario
from rso_lidar.scene import Material

_MOST_CURVES = 200
_MOST_DRAWN = 12


@dataclass(frozen=True, eq=False)
class Budget:
    """Performance of one pixel of a camera against range: a pixel that a facet fills, or one facet of `facet_m2`.

    `target` describes what pixels are counted on: the scenario's target, a square that faces the lidar, or a tumbling box.
    `target_m` are its sides, and `target_area_m2` is its mean silhouette over attitudes. `filled_to_m` is the range to which
    it fills a pixel, infinite for a facet and without a target. `notes` describe omitted effects. `COLUMNS` are the names of
    the results along range, in the order of the table.
    """

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "range_m",
        "photons",
        "fill_fraction",
        "detection_probability",
        "range_precision_m",
        "snr",
        "saturated",
        "false_alarm_probability",
        "pixel_m",
        "pixels_on_target",
        "pixels_across",
        "target_fills_pixel",
    )

    camera: str
    probability: float
    curves: tuple[BudgetCurve, ...]
    target: str
    target_m: tuple[float, ...]
    target_area_m2: float
    filled_to_m: float
    facet_m2: float | None
    false_alarms_per_frame: float
    pixel_rad: float
    notes: tuple[str, ...]

    def range_of_pixels(self, pixels: float) -> float:
        """Return the range [m] at which the target covers a number of pixels, all of it in the field and illuminated.

        Parameters
        ----------
        pixels : number of pixels, above 0
        """
        return math.sqrt(self.target_area_m2 / check_positive("pixels", pixels)) / self.pixel_rad

    def csv_text(self) -> str:
        """Return all curves as one CSV table with a row for each range; column names end in their unit."""
        rows: list[list[Any]] = [["material", "tilt_deg", "divergence_deg", *self.COLUMNS]]
        for curve in self.curves:
            columns = [getattr(curve, name) for name in self.COLUMNS]
            for row in zip(*columns, strict=True):
                values = [int(value) if isinstance(value, np.bool_) else f"{float(value):.7g}" for value in row]
                rows.append([curve.material, f"{curve.tilt_deg:g}", f"{curve.divergence_deg:g}", *values])
        return format_csv(rows)

    def figure(self) -> Any:
        """Return the figure of photons, probability, precision and pixels against range."""
        if len(self.curves) > _MOST_DRAWN:
            raise ScenarioError(
                f"budget: {len(self.curves)} curves are too many for one picture; draw at most {_MOST_DRAWN}, or "
                "write .csv"
            )
        return budget_figure(
            self.curves,
            self.names(),
            f"Link budget of {self.camera}",
            self.about(),
            self.probability,
            filled_to_m=self.filled_to_m,
            small_print=self.notes,
        )

    def save(self, path: str | Path, *, overwrite: bool = False, scheme: Scheme = LIGHT) -> Path:
        """Write the budget as a table or a picture.

        Parameters
        ----------
        path : of the output, .csv, .png, .pdf or .svg
        overwrite : whether an existing file may be replaced
        scheme : of a picture, `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        place = check_writable(path, RESULT_SUFFIXES, overwrite=overwrite)
        if place.suffix.lower() != ".csv":
            return save_figure(self.figure(), place, scheme=scheme)
        return write_text(place, self.csv_text(), overwrite=overwrite)

    def names(self) -> list[str]:
        """Return labels that distinguish the curves."""
        several = [
            len({getattr(c, name) for c in self.curves}) > 1 for name in ("material", "tilt_deg", "divergence_deg")
        ]
        if not any(several):
            several[0] = True
        names = []
        for curve in self.curves:
            words = (curve.material, f"tilt {curve.tilt_deg:g}°", f"beam {curve.divergence_deg:.4g}°")
            names.append(", ".join(word for word, differs in zip(words, several, strict=True) if differs))
        return names

    def about(self) -> str:
        """Describe the facet and the target of the curves."""
        what = "a pixel that a facet fills" if self.facet_m2 is None else f"a facet of {self.facet_m2:g} m²"
        return f"{what}, on the boresight   ·   {self.target}"

    def table(self) -> str:
        """Return a text table of the greatest range of each curve, with photons, precision and pixels there."""
        heads = [
            "material",
            "tilt",
            "beam",
            f"{'filled pixel' if self.facet_m2 is None else 'facet'}, P = {self.probability:g} to",
            "photons",
            "precision",
            "pixel",
            "on target",
        ]
        rows = [heads]
        for curve in self.curves:
            row = [curve.material, f"{curve.tilt_deg:g}°", f"{curve.divergence_deg:.4g}°"]
            if math.isnan(curve.max_range_m):
                rows.append([*row, "never", *["-"] * 4])
                continue
            photons, precision_m, pixels = (
                math.exp(
                    float(np.interp(math.log(curve.max_range_m), np.log(curve.range_m), np.log(np.maximum(y, 1e-30))))
                )
                for y in (curve.photons, curve.range_precision_m, curve.pixels_on_target)
            )
            inside = curve.range_m[0] <= curve.max_range_m <= curve.range_m[-1]
            count = f"{photons:,.0f}" if photons >= 10.0 else f"{photons:.2g}"
            seen = [count, f"{precision_m / units.CM:.1f} cm"] if inside else ["-", "-"]
            ends = " (armed)" if curve.armed_limits else " (fills no more)" if curve.fill_limits else ""
            reach = f"{curve.max_range_m:,.0f} m{ends}"
            on_target = f"{pixels:,.3g} px" if inside else "-"
            rows.append([*row, reach, *seen, f"{curve.max_range_m * self.pixel_rad:.3g} m", on_target])
        return "\n".join([f"{self.camera}: {self.about()}", *align_columns(rows), *self.notes])


def budget(
    camera: Lidar | Scenario | str,
    *,
    range_m: tuple[float, float] | Sequence[float] | np.ndarray | None = None,
    materials: Sequence[str | float | Material] | None = None,
    tilt_deg: Sequence[float] | float = 0.0,
    divergence_deg: Sequence[float] | float | None = None,
    probability: float = 0.95,
    target_m: Sequence[float] | float | None = None,
    facet_m2: float | None = None,
) -> Budget:
    """Compute photons, detection, precision and pixels against range for each material, tilt and divergence.

    Parameters
    ----------
    camera : a lidar, a scenario (its instrument at the start), or the name of a shipped camera
    range_m : nearest and farthest range, or three or more ranges [m] (None: from a fiftieth of the detector's reach to its
        reach)
    materials : names of the catalogue, reflectances, BRDF tables (.csv: incidence_deg, brdf_per_sr), or materials (None: the
        dimmest and the brightest of the scenario's first target, or Lambertian 0.30)
    tilt_deg : angles between the facet's normal and the boresight [deg]
    divergence_deg : full angles of the beam [deg] (None: that of the laser)
    probability : detection probability for which the greatest ranges are solved [1]
    target_m : side of a square, or three sides of a box [m] (None: the scenario's first target, or a square of 1 m on which
        pixels are counted). With a target, greatest ranges end where it no longer fills a pixel
    facet_m2 : area of a facet that may be smaller than a pixel [m²] (None: it fills the pixel)

    Returns
    -------
    Budget
        One curve for each combination of material, tilt and divergence.

    Raises
    ------
    ScenarioError
        For values outside their limits, and for too many curves.

    >>> paper = budget("gsfl_1064")
    >>> round(paper.curves[0].max_range_m, -1)
    3000.0
    """
    lidar, scenario, name = select_camera(camera)
    probability = check_probability(probability)
    if facet_m2 is not None:
        check_positive("facet_m2", facet_m2)
    along_m = choose_ranges_m(range_m, lidar.detector)
    chosen = choose_materials(materials, scenario, lidar.laser.wavelength_m)
    tilts = check_angles_deg("tilt_deg", tilt_deg, 0.0, 89.0)
    widths = check_angles_deg(
        "divergence_deg", lidar.laser.divergence_deg if divergence_deg is None else divergence_deg, 1e-6, 179.0
    )
    if len(chosen) * len(tilts) * len(widths) > _MOST_CURVES:
        raise ScenarioError(
            f"budget: {len(chosen)} materials x {len(tilts)} tilts x {len(widths)} divergences are over {_MOST_CURVES} "
            "curves; request fewer at a time"
        )
    target = choose_target(target_m, scenario)
    receiver, detector = lidar.receiver, lidar.detector
    pixel_rad = receiver.pixel_pitch_m / receiver.focal_length_m
    filled_to_m = math.inf if facet_m2 is not None or target.square_m is None else target.square_m / pixel_rad
    curves = [
        compute_curve(camera_of_width, label, material, tilt, along_m, facet_m2, target, filled_to_m, probability)
        for camera_of_width in (lidar.replace(laser=lidar.laser.replace(divergence_deg=width)) for width in widths)
        for label, material in chosen
        for tilt in tilts
    ]
    n_pixels = receiver.n_rows * receiver.n_cols
    each = float(false_alarm_probability(detector, np.array([min(detector.traits.sees_to_m, FARTHEST_M)]))[0])
    return Budget(
        name,
        probability,
        tuple(curves),
        target.words,
        target.sides_m,
        target.area_m2,
        filled_to_m,
        facet_m2,
        each * n_pixels,
        pixel_rad,
        (
            *_describe_filled_limit(filled_to_m),
            *describe_omissions(lidar, each * n_pixels, retros=materials is None and has_retros(scenario)),
        ),
    )


def _describe_filled_limit(to_m: float) -> tuple[str, ...]:
    """Describe the range to which the budget of a filled pixel holds for the target."""
    if not math.isfinite(to_m):
        return ()
    return (
        f"the target fills a pixel to {to_m:,.0f} m and is found less far than a filled pixel beyond: `rso-lidar check` "
        "casts the body that is there",
    )
