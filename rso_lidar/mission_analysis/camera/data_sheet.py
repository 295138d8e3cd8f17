"""The simulated data sheet of a camera: noise, detection, range and intensity, each with its origin and uncertainty."""

from __future__ import annotations

import importlib.metadata
import json
import math
import textwrap
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rso_lidar import units
from rso_lidar.detector import (
    CameraFigure,
    DetectionPhotons,
    LightCurve,
    describe_window,
    estimate_detection_photons,
    list_assumed_settings,
    list_camera_figures,
    list_neglected_effects,
    place_plate_m,
    simulate_light_curve,
    simulate_walk_curve,
)
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.files import align_columns, check_writable, format_csv, write_text
from rso_lidar.mission_analysis.budgets.inputs import select_camera
from rso_lidar.mission_analysis.camera.data_sheet_figure import NORMAL_95, data_sheet_figure
from rso_lidar.mission_analysis.camera.data_sheet_page import write_data_sheet_page
from rso_lidar.mission_analysis.camera.figure_text import format_interval, format_photons, format_value
from rso_lidar.part import kind_of
from rso_lidar.picture import FIGURE_SUFFIXES, LIGHT, Scheme, save_figure
from rso_lidar.scenario import Lidar, Scenario

PROBABILITIES = (0.5, 0.9, 0.95, 0.99)  # whose photons a data sheet states
_LEVELS = 17  # of light below, and above twice the light of 50 % detection
_FAINTEST = 0.4  # times the light of 50 % detection, where a curve over light begins
_BRIGHTEST = 2.0  # times that light, up to which levels lie close, and times the saturation, where the curve ends
_DECADES = 1e3  # of light in the curve of a detector that does not saturate
_STRONG = 10.0  # times the light of 95 % detection, at which scatter and bias are stated too
_AFTER_RANGE = (
    "saturation_photons",
    "amplitude_crosstalk_",
    "crosstalk_",
    "operability_fraction",
)  # beginnings of names
_WIDTH = 80  # columns of the table


@dataclass(frozen=True, eq=False)
class CameraDataSheet:
    """The simulated data sheet of a camera with its lens and the laser's own pulse.

    `camera` is its name, and `about` describes array, lens and pulse. `figures` are its figures in order, each with its
    origin and uncertainty. `curve` holds detection, range and intensity over light, by trials. `notes` list what the closed
    forms leave out, and which settings are defaults of the package.
    `SUFFIXES` are those of the files that `save` writes.
    """

    SUFFIXES: ClassVar[tuple[str, ...]] = (".csv", ".json", ".html", *FIGURE_SUFFIXES)

    camera: str
    about: str
    figures: tuple[CameraFigure, ...]
    curve: LightCurve
    notes: tuple[str, ...]

    def find(self, name: str) -> CameraFigure:
        """Return the figure of a name such as ``nep_w_per_sqrt_hz``.

        Parameters
        ----------
        name : as `CameraFigure.name`

        Returns
        -------
        CameraFigure

        Raises
        ------
        ScenarioError
            If the camera has no such figure.
        """
        by_name = {figure.name: figure for figure in self.figures}
        if name not in by_name:
            known = ", ".join(by_name)
            raise ScenarioError(f"'{name}': no figure of {self.camera}{did_you_mean(name, by_name)} (known: {known})")
        return by_name[name]

    def table(self) -> str:
        """Return a text table of 80 columns: each figure with its interval and origin, then the notes."""
        rows = [(figure.meaning, format_value(figure), format_interval(figure), figure.how) for figure in self.figures]
        lines = [f"{self.camera}: {self.about}", *self.notes]
        first, *rest = (line for text in lines for line in textwrap.wrap(text, _WIDTH, subsequent_indent="  "))
        lead = len(textwrap.wrap(lines[0], _WIDTH, subsequent_indent="  ")) - 1
        table = align_columns([("", "value", "95 % or error", "obtained"), *rows], left=(0, 3))
        return "\n".join([first, *rest[:lead], *table, *rest[lead:]])

    def csv_text(self) -> str:
        """Return the curve over light as CSV, a row for each level; column names end in their unit."""
        columns = [field.name for field in fields(LightCurve) if field.name != "trials"]
        values = zip(*(getattr(self.curve, name) for name in columns), strict=True)
        rows = [["" if math.isnan(value) else f"{float(value):.7g}" for value in row] for row in values]
        return format_csv([[*columns, "trials"], *([*row, str(self.curve.trials)] for row in rows)])

    def json_text(self) -> str:
        """Return figures and curve as JSON; what is unknown or without limit is null."""
        curve = {field.name: np.asarray(getattr(self.curve, field.name)).tolist() for field in fields(LightCurve)}
        content = {
            "camera": self.camera,
            "about": self.about,
            "rso_lidar_version": importlib.metadata.version("rso-lidar"),
            "figures": [asdict(figure) for figure in self.figures],
            "curve": curve,
            "notes": list(self.notes),
        }
        return json.dumps(_drop_non_finite(content), indent=1, ensure_ascii=False) + "\n"

    def html_text(self, scheme: Scheme = LIGHT) -> str:
        """Return the data sheet as one HTML page that needs no other file.

        Parameters
        ----------
        scheme : `LIGHT` or `DARK`
        """
        return write_data_sheet_page(
            self.camera, self.about, self.figures, self.curve, self.notes, self.figure(), scheme
        )

    def figure(self) -> Any:
        """Return the figure of detection, range scatter, range bias and signal over noise against light."""
        return data_sheet_figure(self.camera, self.about, self.figures, self.curve)

    def save(self, path: str | Path, *, overwrite: bool = False, scheme: Scheme = LIGHT) -> Path:
        """Write the data sheet as a page, a picture, or a table.

        Parameters
        ----------
        path : of the output: .html for all, .json for figures and curve, .csv for the curve, or a picture (.png, .pdf, .svg)
        overwrite : whether an existing file may be replaced
        scheme : of pages and pictures, `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        place = check_writable(path, self.SUFFIXES, overwrite=overwrite)
        suffix = place.suffix.lower()
        if suffix in FIGURE_SUFFIXES:
            return save_figure(self.figure(), place, scheme=scheme)
        text = {".csv": self.csv_text, ".json": self.json_text}.get(suffix, lambda: self.html_text(scheme))()
        return write_text(place, text, overwrite=overwrite)


def data_sheet(camera: Lidar | Scenario | str, *, trials: int = 4000) -> CameraDataSheet:
    """Simulate the data sheet of a camera: detector, lens, and the laser's own pulse.

    Parameters
    ----------
    camera : a lidar, a scenario (its instrument at the start), or the name of a shipped camera
    trials : of each level of light; fewer for detectors that average many pulses

    Returns
    -------
    CameraDataSheet
        What the detector has: of a user's own object, what its traits and its trials tell.

    Raises
    ------
    ScenarioError
        For an unknown camera, and for fewer than 50 trials.

    >>> sheet = data_sheet("gsfl_1064", trials=200)
    >>> round(sheet.find("excess_noise_factor").value, 2), round(sheet.find("photons_at_95_percent").value, -1)
    (3.52, 1000.0)
    """
    lidar, _, name = select_camera(camera)
    detector, pulse, receiver = lidar.detector, lidar.pulse, lidar.receiver
    n_pixels = receiver.n_rows * receiver.n_cols
    quantities = list(list_camera_figures(detector, pulse, lidar.laser.wavelength_m, n_pixels))
    needed = estimate_detection_photons(detector, pulse, np.array(PROBABILITIES), trials)
    quantities += _list_detection(needed)
    half, certain = float(needed.photons[0]), float(needed.photons[PROBABILITIES.index(0.95)])
    full = next((quantity.value for quantity in quantities if quantity.name == "saturation_photons"), math.inf)
    curve = simulate_light_curve(detector, pulse, _choose_levels(half, full, detector.traits.threshold_photons), trials)
    quantities += _list_ranging(lidar, certain, full, trials)
    quantities.sort(key=lambda quantity: quantity.name.startswith(_AFTER_RANGE))
    if math.isfinite(half) and math.isfinite(full):
        formula = f"20 log10 of saturation over the photons of 50 % detection, {full / half:,.0f} : 1"
        ratio = 20.0 * math.log10(full / half)
        place = next(k for k, quantity in enumerate(quantities) if quantity.name == "saturation_photons") + 1
        quantities.insert(
            place, CameraFigure("dynamic_range_db", "dynamic range", ratio, "dB", "closed form", formula=formula)
        )
    return CameraDataSheet(name, _describe_camera(lidar), tuple(quantities), curve, tuple(_list_notes(lidar)))


def _list_detection(needed: DetectionPhotons) -> Iterator[CameraFigure]:
    """Yield the photons of each probability of detection."""
    how = "form and trials" if needed.how.startswith("closed form") else "trials"
    for case, probability in enumerate(needed.probability.tolist()):
        percent = f"{100.0 * probability:g}"
        value, low, high = (float(values[case]) for values in (needed.photons, needed.low, needed.high))
        yield CameraFigure(
            f"photons_at_{percent}_percent",
            f"photons for {percent} % detection",
            value,
            "photons",
            how,
            low,
            high,
            needed.how,
        )


def _list_ranging(lidar: Lidar, certain: float, full: float, trials: int) -> Iterator[CameraFigure]:
    """Yield scatter, bias and signal over noise at two lights, and the walk over the detector's dynamic range.

    Parameters
    ----------
    certain : photons of 95 % detection; where they are infinite there is nothing to yield
    """
    detector, pulse = lidar.detector, lidar.pulse
    if not math.isfinite(certain):
        return
    lights = {"threshold": certain, "strong": _STRONG * certain}
    curve = simulate_light_curve(detector, pulse, np.array(list(lights.values())), trials)
    how = f"{curve.trials:,} trials"
    for level, (name, photons) in enumerate(lights.items()):
        at = f"at {format_photons(photons)} photons"
        for key, meaning, values_m, errors_m in (
            ("range_sigma", "range sigma", curve.range_sigma_m, curve.range_sigma_error_m),
            ("range_bias", "range bias", curve.range_bias_m, curve.range_bias_error_m),
        ):
            value, half = float(values_m[level]), NORMAL_95 * float(errors_m[level])
            yield CameraFigure(f"{key}_{name}_m", f"{meaning} {at}", value, "m", how, value - half, value + half)
        if np.isfinite(curve.snr[level]):
            yield CameraFigure(
                f"snr_{name}", f"SNR {at}", float(curve.snr[level]), "", "closed form", formula="as amplitudes"
            )
        spread = float(curve.intensity_sigma_counts[level])
        if spread > 0.0:
            ratio = float(curve.intensity_counts[level]) / spread
            half = NORMAL_95 * ratio / math.sqrt(2.0 * curve.trials)
            yield CameraFigure(
                f"intensity_snr_{name}",
                f"SNR of counts {at}",
                ratio,
                "",
                how,
                ratio - half,
                ratio + half,
                "mean counts over their scatter",
            )
    to = min(full, _DECADES * certain)
    if to > 2.0 * certain:
        levels = np.geomspace(certain, to, _LEVELS)
        walk = simulate_walk_curve(
            detector, pulse, levels, pixels=curve.trials, range_m=place_plate_m(detector.traits, pulse)
        )
        error_m = NORMAL_95 * float(np.nanmax(walk.noise_m)) / math.sqrt(curve.trials)
        half_m = walk.half_walk_m
        span = f"from {format_photons(certain)} to {format_photons(to)} photons"
        formula = f"half the span of the median range error {span}"
        low_m, high_m = max(half_m - error_m, 0.0), half_m + error_m
        yield CameraFigure("range_walk_m", "range walk, ±", half_m, "m", how, low_m, high_m, formula)


def _choose_levels(half: float, full: float, threshold: float) -> np.ndarray:
    """Return levels of light [photons]: dense where detection rises, and on to beyond saturation."""
    start = half if math.isfinite(half) else max(threshold, 1e-3)
    rise, top = _BRIGHTEST * start, min(_BRIGHTEST * full, _DECADES * start)
    upper = np.geomspace(rise, max(top, 2.0 * rise), _LEVELS)
    return np.concatenate([np.geomspace(_FAINTEST * start, rise, _LEVELS)[:-1], upper])


def _describe_camera(lidar: Lidar) -> str:
    """Describe detector, array, lens and pulse in a line."""
    laser, receiver = lidar.laser, lidar.receiver
    return (
        f"{kind_of(lidar.detector)}, {receiver.n_rows} x {receiver.n_cols} pixels of {receiver.pixel_pitch_um:g} µm behind "
        f"{receiver.focal_length_m / units.MM:.4g} mm f/{receiver.focal_length_m / receiver.aperture_m:.3g} "
        f"(IFOV {1e3 * receiver.ifov_rad / units.MRAD:.4g} µrad), pulse of {laser.pulse_fwhm_s / units.NS:.3g} ns at "
        f"{laser.wavelength_nm:g} nm; photons are those on a pixel after the lens"
    )


def _list_notes(lidar: Lidar) -> Iterator[str]:
    """Yield what a reader must know beside the figures."""
    yield f"Window: {describe_window(lidar.detector)}. In the dark; pixels do not affect each other."
    if neglected := list_neglected_effects(lidar.detector):
        yield f"Closed forms leave out: {', '.join(neglected)}. Trials count them, but for effects between pixels."
    if assumed := list_assumed_settings(lidar.detector, lidar.unstated_settings):
        yield f"Defaults of the package, not figures of your camera: {', '.join(assumed)}."


def _drop_non_finite(value: Any) -> Any:
    """Return a value of JSON in which numbers that are not finite are None."""
    if isinstance(value, dict):
        return {key: _drop_non_finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_drop_non_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
