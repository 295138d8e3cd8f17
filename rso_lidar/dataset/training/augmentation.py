"""Augmentation by the physics of the sensor: other draws of its noise, less energy, and turns about the boresight.

The sensor would not measure an image that is only made brighter or noisier. These augmentations change only what differs
between flashes of the sensor. Each takes a frame (a dict of arrays) and a random generator, and returns the changed frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rso_lidar.dataset.reading.random_access import Split
from rso_lidar.dataset.shards.layout import find_camera
from rso_lidar.errors import DatasetError

_NOISY = (
    "range_m",
    "intensity_counts",
    "saturated",
    "true_range_m",
    "photons",
    "detection_probability",
    "range_sigma_m",
)  # the reading, and what its noise is drawn from
IMAGES = (
    *_NOISY,
    "target",
    "part",
    "part_class_id",
    "oversampled_range_m",
    "oversampled_photons",
    "normal",
)
_FALSE_SIGMAS, _FALSE_M = 6.0, 0.5  # a report farther from the truth than both is noise or another cluster; assumed
_BIN = 16  # pixels of similar light whose counts give one point of the curve: their mean scatters by a quarter of one pixel
_CERTAIN = 4.0  # normal deviates: a probability within 3e-5 of 0 or 1 has no information on the pixel's threshold
_CENTRED_PX = 0.01  # tolerance of the principal point in turns: far below a pixel, far above rounding


@dataclass(frozen=True)
class RedrawNoise:
    """Draw the sensor's noise again for the same light.

    Each pixel reports its labelled cluster with its `detection_probability`, at the true range with a normal error of
    standard deviation `range_sigma_m`. Counts are drawn in photons, with the variance `noise_photons`² + `excess` · photons,
    and converted by the mean counts of equally bright pixels of the frame. Reports of noise and of other clusters stay,
    unless the pixel now reports its labelled cluster.

    Assumptions: pixels are independent (a jitter that all pixels share is drawn for each pixel), the mean of the reports is
    the true range, and counts have the variance above. The defaults are those of the default `gsfl`, whose `excess` is its
    excess noise factor over its quantum efficiency.

    Parameters
    ----------
    excess : variance of the signal over its photons
    noise_photons : rms noise of the amplifier [photons]
    """

    excess: float = 4.4
    noise_photons: float = 127.0
    needs: tuple[str, ...] = _NOISY

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the frame with another draw of its noise."""
        return self.draw(frame, {}, rng)

    def draw(
        self, frame: dict[str, np.ndarray], changed: dict[str, np.ndarray], rng: np.random.Generator
    ) -> dict[str, np.ndarray]:
        """Draw a reading of other light than that of the frame. The frame's own counts give counts over photons.

        Parameters
        ----------
        frame : the unchanged frame
        changed : `photons`, `detection_probability` and `range_sigma_m` of the other light; those of the frame if absent
        rng : random generator

        Returns
        -------
        The frame with the other light and its reading.
        """
        lit = np.flatnonzero((frame["photons"] > 0.0) & np.isfinite(frame["range_sigma_m"]))
        true_m, photons, sigma_m = (frame[name].ravel()[lit] for name in ("true_range_m", "photons", "range_sigma_m"))
        now = {name: changed.get(name, frame[name]) for name in ("photons", "detection_probability", "range_sigma_m")}
        light, probability, spread_m = (values.ravel()[lit] for values in now.values())
        range_m, intensity, saturated = (frame[name].copy() for name in ("range_m", "intensity_counts", "saturated"))
        with np.errstate(invalid="ignore"):
            beside_m = np.abs(range_m.ravel()[lit] - true_m)
            mine = beside_m <= np.maximum(_FALSE_SIGMAS * sigma_m, _FALSE_M)
        reported, counts = lit[mine], intensity.ravel()[lit[mine]]
        full = photons[mine][saturated.ravel()[reported] > 0].min(initial=np.inf)
        for values, none in ((range_m, np.nan), (intensity, 0), (saturated, 0)):
            values.reshape(-1)[reported] = none
        again = rng.random(len(lit)) < probability
        normal, other = rng.standard_normal((2, int(again.sum())))
        at, light = lit[again], light[again]
        seen = light + other * np.sqrt(self.noise_photons**2 + self.excess * light)
        range_m.reshape(-1)[at] = true_m[again] + spread_m[again] * normal
        new_counts = _count_by_light(photons[mine], counts, np.maximum(seen, 0.0))
        intensity.reshape(-1)[at] = np.clip(np.rint(new_counts), 1, 65_535)
        saturated.reshape(-1)[at] = light >= full
        return frame | now | {"range_m": range_m, "intensity_counts": intensity, "saturated": saturated}


def _count_by_light(photons: np.ndarray, counts: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the counts (pixel) that photons give, interpolated between the mean counts of pixels of similar light.

    Below the faintest and above the brightest mean, counts are proportional to photons.

    Parameters
    ----------
    photons, counts : (report) of the reports of a frame
    wanted : (pixel) photons to convert
    """
    if not len(photons):
        return np.ones(len(wanted))
    order = np.argsort(photons, kind="stable")
    edges = np.arange(0, len(order), _BIN)
    size = np.diff(np.append(edges, len(order)))
    level = np.add.reduceat(photons[order].astype(float), edges) / size
    mean = np.add.reduceat(counts[order].astype(float), edges) / size
    new_counts = np.interp(wanted, level, mean)
    dim, bright = wanted < level[0], wanted > level[-1]
    new_counts[dim] = mean[0] * wanted[dim] / level[0]
    new_counts[bright] = mean[-1] * wanted[bright] / level[-1]
    if len(photons) > _BIN:
        new_counts = np.minimum(new_counts, max(float(counts.max()), 1.0))
    return np.asarray(new_counts)


@dataclass(frozen=True)
class LowerEnergy:
    """Lower the energy of the pulse by a random factor: change the labels of light, then draw the noise again.

    The factor is log-uniform from `least` to 1, and multiplies the photons. The probability and the standard deviation of
    range follow their mean curves over photons, which `of` measures from a split; the probability as its normal deviate. A
    pixel that differs from the mean curve, such as by its threshold, keeps the difference. Outside the curve, its end is
    used. `RedrawNoise` then draws the noise.

    Parameters
    ----------
    photons, normal, sigma_m : (level) the mean curves: photons, the standard normal deviate of the probability, and the
        standard deviation of range [m]
    least : smallest factor
    redraw : augmentation that draws the noise
    """

    photons: tuple[float, ...]
    normal: tuple[float, ...]
    sigma_m: tuple[float, ...]
    least: float = 0.3
    redraw: RedrawNoise = RedrawNoise()
    needs: tuple[str, ...] = RedrawNoise.needs

    @classmethod
    def of(cls, split: Split, least: float = 0.3, *, frames: int = 200, sensor: int = 0) -> LowerEnergy:
        """Measure the mean curves of a split.

        Parameters
        ----------
        split : split to train on
        least : smallest factor

        Other Parameters
        ----------------
        frames : approximate number of frames to read, spread over the split
        sensor : number of the sensor whose frames are read; each sensor has its own curves

        Returns
        -------
        The augmentation for frames of this sensor.

        Raises
        ------
        DatasetError
            If the split has no frame of the sensor with light.
        """
        from scipy.special import ndtri

        own = np.flatnonzero(split.column("sensor_id") == sensor)
        own = own[:: max(len(own) // frames, 1)]
        arrays = split.read(own, ("photons", "detection_probability", "range_sigma_m")) if len(own) else {}
        lit = np.isfinite(arrays["range_sigma_m"]) & (arrays["photons"] > 0.0) if arrays else np.zeros(0, bool)
        if not lit.any():
            raise DatasetError(f"{split!r}: no frame of sensor {sensor} has light; choose another sensor")
        photons, probability, sigma_m = (arrays[name][lit].astype(float) for name in arrays)
        level = np.floor(np.log2(photons) * 4.0).astype(np.int64)
        kinds, of = np.unique(level, return_inverse=True)
        count = np.bincount(of)
        deviate = np.clip(ndtri(np.clip(probability, 1e-9, 1.0 - 1e-9)), -_CERTAIN, _CERTAIN)
        return cls(
            tuple((2.0 ** ((kinds + 0.5) / 4.0)).tolist()),
            tuple((np.bincount(of, deviate) / count).tolist()),
            tuple((np.bincount(of, sigma_m) / count).tolist()),
            least,
        )

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the frame of a weaker pulse."""
        from scipy.special import ndtr, ndtri

        factor = math.exp(rng.uniform(math.log(self.least), 0.0))
        lit = np.isfinite(frame["range_sigma_m"]) & (frame["photons"] > 0.0)
        before = np.log(frame["photons"][lit].astype(float))
        after = before + math.log(factor)
        level = np.log(self.photons)
        own = ndtri(np.clip(frame["detection_probability"][lit].astype(float), 1e-9, 1.0 - 1e-9))
        mean, lower = (np.interp(light, level, self.normal) for light in (before, after))
        beside = np.where(np.abs(own) < _CERTAIN, own - mean, 0.0)
        spread = np.interp(after, level, np.log(self.sigma_m)) - np.interp(before, level, np.log(self.sigma_m))
        changed = {name: frame[name].copy() for name in ("photons", "detection_probability", "range_sigma_m")}
        changed["photons"][lit] *= np.float32(factor)
        changed["detection_probability"][lit] = np.minimum(ndtr(lower + beside), frame["detection_probability"][lit])
        changed["range_sigma_m"][lit] *= np.exp(np.maximum(spread, 0.0)).astype(np.float32)
        return self.redraw.draw(frame, changed, rng)


@dataclass(frozen=True)
class QuarterTurns:
    """Turn the frame about the boresight by a random number of quarter turns, with pose, box and direction of the Sun.

    The lidar then has another roll angle. This is exact for a square array whose boresight passes through its middle; other
    arrays are refused. The camera's fixed pattern turns with the image, which a real roll would not do. A camera beside the
    lidar does not turn about its own boresight then, so its arrays among the fields are refused.
    """

    needs: tuple[str, ...] = ("intrinsics_px",)

    def check_fields(self, fields: tuple[str, ...]) -> None:
        """Refuse arrays of cameras among the fields.

        Parameters
        ----------
        fields : names of the arrays

        Raises
        ------
        DatasetError
            If the fields contain one.
        """
        _refuse_cameras("QuarterTurns", fields)

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the turned frame."""
        _check_centred(frame)
        return turn_frame(frame, int(rng.integers(4)))


@dataclass(frozen=True)
class MirrorImages:
    """Mirror half of the frames from left to right, with position, box and direction of the Sun.

    A mirrored craft is another craft, unless it has a plane of symmetry, and its attitude is no rotation. So
    `quaternion_xyzw` among the fields is refused. So are arrays of cameras, whose mounts would be mirrored, too.
    """

    needs: tuple[str, ...] = ("intrinsics_px",)

    def check_fields(self, fields: tuple[str, ...]) -> None:
        """Refuse an attitude and arrays of cameras among the fields.

        Parameters
        ----------
        fields : names of the arrays

        Raises
        ------
        DatasetError
            If the fields contain one.
        """
        _refuse_cameras("MirrorImages", fields)
        if "quaternion_xyzw" in fields:
            raise DatasetError(
                "MirrorImages: the attitude of a mirrored craft is no rotation; leave out quaternion_xyzw, or MirrorImages"
            )
        if "keypoint_px" in fields:
            raise DatasetError(
                "MirrorImages: left and right keypoints of a mirrored craft change places; leave out keypoint_px, or "
                "MirrorImages"
            )

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the frame or its mirror image."""
        self.check_fields(tuple(frame))
        _check_centred(frame)
        return mirror_frame(frame) if rng.random() < 0.5 else frame


def _refuse_cameras(name: str, fields: Iterable[str]) -> None:
    """Raise `DatasetError` if fields of an augmentation of some name have arrays of a camera beside the lidar."""
    of_cameras = [field for field in fields if find_camera(field) is not None]
    if of_cameras:
        raise DatasetError(
            f"{name}: changes the lidar's images alone, and {of_cameras[0]} would not fit them; leave out {name}, or the "
            "arrays of cameras"
        )


def turn_frame(frame: dict[str, np.ndarray], turns: int) -> dict[str, np.ndarray]:
    """Turn a frame about the boresight, counterclockwise as seen in the image.

    Parameters
    ----------
    turns : number of quarter turns

    Returns
    -------
    The turned frame. The lidar has rolled the other way.
    """
    from scipy.spatial.transform import Rotation

    turned = dict(frame)
    for name in IMAGES:
        if name in frame:
            turned[name] = np.ascontiguousarray(np.rot90(frame[name], turns))
    # Lidar axes: x is right and y down. A counterclockwise quarter turn takes right to up, so +x to -y.
    turn = Rotation.from_euler("z", -90.0 * turns, degrees=True)
    matrix = np.rint(turn.as_matrix())
    for name in ("position_m", "sun_direction"):
        if name in frame:
            turned[name] = (matrix @ frame[name].astype(float)).astype(frame[name].dtype)
    if "normal" in frame:
        turned["normal"] = np.einsum("ij,rcj->rci", matrix, turned["normal"]).astype(frame["normal"].dtype)
    if "quaternion_xyzw" in frame and np.isfinite(frame["quaternion_xyzw"]).all():
        attitude = turn * Rotation.from_quat(frame["quaternion_xyzw"])
        turned["quaternion_xyzw"] = attitude.as_quat(canonical=True)
    if "box_px" in frame and (frame["box_px"] >= 0).all():
        last = frame["range_m"].shape[0] - 1 if "range_m" in frame else round(2.0 * float(frame["intrinsics_px"][2]))
        first_row, first_col, last_row, last_col = frame["box_px"].tolist()
        for _ in range(turns % 4):
            first_row, first_col, last_row, last_col = last - last_col, first_row, last - first_col, last_row
        turned["box_px"] = np.array([first_row, first_col, last_row, last_col], frame["box_px"].dtype)
    if "keypoint_px" in frame:
        last_px, place_px = round(2.0 * float(frame["intrinsics_px"][2])), frame["keypoint_px"]
        for _ in range(turns % 4):
            place_px = np.stack([last_px - place_px[:, 1], place_px[:, 0]], axis=1)
        turned["keypoint_px"] = place_px.astype(frame["keypoint_px"].dtype)
    return turned


def mirror_frame(frame: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Mirror a frame from left to right."""
    mirrored = dict(frame)
    for name in IMAGES:
        if name in frame:
            mirrored[name] = np.ascontiguousarray(frame[name][:, ::-1])
    for name in ("position_m", "sun_direction"):
        if name in frame:
            mirrored[name] = frame[name] * np.array([-1, 1, 1], frame[name].dtype)
    if "normal" in frame:
        mirrored["normal"] = mirrored["normal"] * np.array([-1, 1, 1], frame["normal"].dtype)
    if "box_px" in frame and (frame["box_px"] >= 0).all():
        last = frame["range_m"].shape[1] - 1 if "range_m" in frame else round(2.0 * float(frame["intrinsics_px"][2]))
        box = frame["box_px"]
        mirrored["box_px"] = np.array([box[0], last - box[3], box[2], last - box[1]], box.dtype)
    return mirrored


def _check_centred(frame: dict[str, np.ndarray]) -> None:
    """Refuse a frame whose boresight does not pass through the middle of a square array."""
    fx, fy, cx, cy = frame["intrinsics_px"].tolist()
    shapes = {frame[name].shape[:2] for name in IMAGES if name in frame and not name.startswith("oversampled")}
    square = all(rows == cols for rows, cols in shapes)
    middle = all(abs(2.0 * c - (rows - 1)) < 2.0 * _CENTRED_PX for rows, _ in shapes for c in (cx, cy))
    if not square or not middle or abs(fx - fy) > 1e-9 * fx:
        raise DatasetError(
            f"augmentation: turns and mirror images need a square array about the boresight, not {sorted(shapes)} with the "
            f"principal point at ({cx:g}, {cy:g}); leave them out"
        )
