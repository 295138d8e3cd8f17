"""Statistics of labelled frames, by class and split, and leaks: numbers that reveal the class without its shape.

A column of numbers leaks if its distribution in one class differs from that in all others. Two tests look for this: a
two-sample Kolmogorov-Smirnov test, and a test of both ends of the range of the class. The second computes how probable it
is that no sample of the class lies beyond its extreme value, given the share of the other samples beyond it. Both are
corrected for the number of tests.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.dataset.shards.layout import list_cameras, name_camera_array

COLUMNS = (
    "class_id",
    "present",
    "range_to_target_m",
    "lit_pixels",
    "reporting_pixels",
    "total_photons",
    "position_m",
    "intrinsics_px",
    "step",
    "draw",
)
_IMAGE_COLUMNS = ("target_pixels", "target_electrons", "full_pixels")  # of each camera beside the lidar
_DARK_ELECTRONS = 1.0  # in a pixel on a target: below the noise of any camera; assumed
_SHARES = (0.0, 0.5, 1.0)
_FEW_PIXELS, _MANY_PIXELS = 1, 100  # reporting pixels: detected at all; needed to classify (Fuller et al., sec. 5)
_CHANCE = 1e-3  # of a false alarm in a whole check
_LEAST_DIFFERENCE = 0.15  # greatest difference of two cumulative distributions that training can ignore; assumed
_LEAST_SAMPLES = 8  # of a class; assumed: fewer prove no difference at this probability of a false alarm
_CENTRED_PX = 2.0  # from the centre of the image; assumed
_CENTRED_SHARE = 0.9  # of the frames with a target; assumed


def list_columns(names: Iterable[str]) -> tuple[str, ...]:
    """List the arrays of a shard that statistics are made of: those of `COLUMNS`, and some of each camera.

    Parameters
    ----------
    names : of all arrays of the shard
    """
    return *COLUMNS, *(name_camera_array(camera, field) for camera in list_cameras(names) for field in _IMAGE_COLUMNS)


@dataclass(frozen=True, eq=False)
class LabelStatistics:
    """Columns of labels of many frames, with their table and warnings.

    Parameters
    ----------
    columns : arrays (frame) by name: those of `list_columns`, and drawn numbers
    classes : names of the classes
    """

    columns: Mapping[str, np.ndarray]
    classes: Sequence[str]

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras of whose images there are labels; a drawn field of a camera is none."""
        return tuple(
            name for name in list_cameras(self.columns) if name_camera_array(name, _IMAGE_COLUMNS[0]) in self.columns
        )

    @property
    def offset_px(self) -> np.ndarray:
        """Distance of the target's origin from the centre of the image (frame) [px], NaN without a target."""
        x, y, z = self.columns["position_m"].T
        offset: np.ndarray = np.hypot(x, y) / z * self.columns["intrinsics_px"][:, 0]
        return offset

    def tabulate(self) -> list[str]:
        """Return a table of ranges, pixels and photons by class, as lines."""
        ranges, pixels, many = "range, m (min, median, max)", "reporting pixels", "over 100"
        lines = [f"{'class':20} {'frames':>8} {ranges:>29} {pixels:>22} {'none':>6} {many:>9}"]
        for k, name in enumerate(self.classes):
            mine = self.columns["class_id"] == k
            if not mine.any():
                continue
            ranges = "  ".join(f"{x:8.4g}" for x in np.quantile(self.columns["range_to_target_m"][mine], _SHARES))
            reporting = self.columns["reporting_pixels"][mine]
            pixels = "  ".join(f"{x:6.0f}" for x in np.quantile(reporting, _SHARES))
            none, many = np.mean(reporting < _FEW_PIXELS), np.mean(reporting > _MANY_PIXELS)
            lines.append(f"{name:20} {mine.sum():8,} {ranges:>29} {pixels:>22} {none:6.0%} {many:9.0%}")
        without = int((self.columns["present"] == 0).sum())
        lines += [f"{'no target':20} {without:8,}"] if without else []
        for camera in self.cameras:
            lines += ["", *self._tabulate_images(camera)]
        return lines

    def _tabulate_images(self, camera: str) -> list[str]:
        """Return a table of pixels and light by class in the images of a camera, as lines."""
        pixels, light = "pixels on target", "electrons in a pixel"
        lines = [f"{f'camera {camera}':20} {'frames':>8} {pixels:>29} {light:>22} {'none':>6} {'full':>9}"]
        on_target, mean, is_full = self._measure_images(camera)
        for k, name in enumerate(self.classes):
            mine = self.columns["class_id"] == k
            if not mine.any():
                continue
            pixels = "  ".join(f"{x:8.0f}" for x in np.quantile(on_target[mine], _SHARES))
            seen = mine & (on_target > 0)
            light = "  ".join(f"{x:6.4g}" for x in np.quantile(mean[seen], _SHARES)) if seen.any() else ""
            none, full = np.mean(on_target[mine] == 0), np.mean(is_full[mine])
            lines.append(f"{name:20} {mine.sum():8,} {pixels:>29} {light:>22} {none:6.0%} {full:9.0%}")
        return lines

    def _measure_images(self, camera: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return for each frame the pixels on the target, their mean electrons, and whether half as many pixels are full."""
        on_target, light, full = (self.columns[name_camera_array(camera, field)] for field in _IMAGE_COLUMNS)
        return on_target, light / np.maximum(on_target, 1), (full > 0) & (full >= 0.5 * on_target)

    def warn(self) -> list[str]:
        """Return one line for each leak, and for each finding about targets and returns."""
        first = self.columns["draw"] == 0  # other noise draws share the pose, so they are not independent
        with_target = first & (self.columns["present"] == 1)
        independent = with_target & (self.columns["step"] == 0)  # later frames of an encounter resemble its first
        known = {*COLUMNS, *(name_camera_array(camera, field) for camera in self.cameras for field in _IMAGE_COLUMNS)}
        drawn = {name: values for name, values in self.columns.items() if name not in known}
        tested = {"range": self.columns["range_to_target_m"], "offset from the centre": self.offset_px} | drawn
        reporting = np.where(self.columns["present"] == 1, self.columns["reporting_pixels"], -1)
        return [
            *find_leaks(
                {name: values[independent] for name, values in tested.items()},
                self.columns["class_id"][independent],
                self.classes,
            ),
            *find_constants(self.offset_px[with_target], reporting[first]),
            *(line for camera in self.cameras for line in self._warn_of_images(camera, with_target)),
        ]

    def _warn_of_images(self, camera: str, chosen: np.ndarray) -> list[str]:
        """Return one line for each finding about the images of a camera in chosen frames (frame) with a target."""
        on_target, mean, is_full = (values[chosen] for values in self._measure_images(camera))
        findings = (
            (on_target == 0, "see nothing of it; widen the camera's field, or turn its mount"),
            (
                (on_target > 0) & (mean < _DARK_ELECTRONS),
                f"have less than {_DARK_ELECTRONS:g} electron in its pixels; light it by view.sun or world.sun_direction",
            ),
            (
                is_full,
                "are full in as many pixels as half of the target has; shorten the exposure, or take auto_exposure",
            ),
        )
        return [
            f"camera {camera}: {np.mean(where):.1%} of the images of frames with a target {text}"
            for where, text in findings
            if where.any()
        ]


def find_leaks(columns: Mapping[str, np.ndarray], group: np.ndarray, names: Sequence[str]) -> list[str]:
    """Find columns whose values reveal the group.

    Parameters
    ----------
    columns : numbers (sample) by name, NaN where there is none
    group : (sample) index of the group, such as the class

    Returns
    -------
    One line for each leak.
    """
    from scipy.stats import ks_2samp

    lines = []
    tests = max(1, 3 * len(columns) * len(names))
    for column, values in columns.items():
        known = np.isfinite(values)
        for k, name in enumerate(names):
            inside, outside = values[known & (group == k)], values[known & (group != k)]
            if min(len(inside), len(outside)) < _LEAST_SAMPLES:
                continue
            test = ks_2samp(inside, outside)
            if test.pvalue * tests < _CHANCE and test.statistic > _LEAST_DIFFERENCE:
                lines.append(
                    f"{column} tells the class: its distribution in '{name}' differs from that in the others (Kolmogorov-"
                    f"Smirnov {test.statistic:.2f}, median {np.median(inside):.4g} against {np.median(outside):.4g})"
                )
                continue
            for end, beyond in (("begins", outside < inside.min()), ("ends", outside > inside.max())):
                if len(inside) * np.log1p(-beyond.mean() * (1.0 - 1e-12)) < np.log(_CHANCE / tests):
                    at = inside.min() if end == "begins" else inside.max()
                    lines.append(
                        f"{column} tells the class: in '{name}' it {end} at {at:.4g}, and {beyond.mean():.0%} of the others "
                        "are beyond"
                    )
    return lines


def find_constants(offset_px: np.ndarray, reporting: np.ndarray) -> list[str]:
    """Find a target that is always centred, and frames without returns.

    Parameters
    ----------
    offset_px : (frame) distance of the target's origin from the centre of the image [px], NaN without a target
    reporting : (frame) number of pixels that reported the target, negative without a target

    Returns
    -------
    One line for each finding.
    """
    lines = []
    known = offset_px[np.isfinite(offset_px)]
    if len(known) >= _LEAST_SAMPLES and np.mean(known < _CENTRED_PX) > _CENTRED_SHARE:
        lines.append(
            f"the target is centred in {np.mean(known < _CENTRED_PX):.0%} of the frames, and a network can learn that; "
            "widen view.offset_fraction, or, with a PTU, vary its pointing"
        )
    shown = reporting[reporting >= 0]
    if len(shown) and np.mean(shown == 0) > 0.0:
        lines.append(f"{np.mean(shown == 0):.1%} of the frames with a target have no return from it")
    return lines
