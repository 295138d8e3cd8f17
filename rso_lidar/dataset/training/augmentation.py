"""Augmentation by the physics of the sensor: other draws of its noise, less energy, and turns about the boresight.

A brighter or noisier image is no frame of the sensor. These are: what changes is what another flash would have changed.
Each takes a frame as a dict of arrays and a generator, and returns the changed frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar.dataset.reading.random_access import Split
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
)
_FALSE_SIGMAS, _FALSE_M = 6.0, 0.5  # farther from the truth than both, a report is noise or another cluster
_BIN = 16  # pixels of similar light whose counts give one point of the curve
_CERTAIN = 4.0  # standard normal deviation from which a probability says nothing of the pixel
_CENTRED_PX = 0.01  # of the principal point, for turns


@dataclass(frozen=True)
class RedrawNoise:
    """Draw the sensor's noise again for the same light.

    Each pixel reports what is there with its `detection_probability`, at the true range with a normal error of
    `range_sigma_m`. The counts are those that pixels as bright have in the frame, with a normal error whose variance is that
    of `noise_photons`² + `excess` · photons, as photons. Reports of noise and of other clusters are kept as they are, unless
    the pixel now reports what is there.

    It is assumed that pixels are independent (a jitter that all share is drawn for each), that the mean of the reports is
    the true range, and that counts follow the two figures. Their defaults are those of the default `gsfl`, whose excess is
    F / QE.

    Parameters
    ----------
    excess : variance of the signal over its photons.
    noise_photons : rms noise of the amplifier [photons].
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
        """Draw a reading of other light than that of the frame, whose counts tell how they depend on light.

        Parameters
        ----------
        frame : as it is.
        changed : photons, probability and deviation of the other light; what is left out is the frame's.
        rng : random generator.

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
        found = _count_by_light(photons[mine], counts, np.maximum(seen, 0.0))
        intensity.reshape(-1)[at] = np.clip(np.rint(found), 1, 65_535)
        saturated.reshape(-1)[at] = light >= full
        return frame | now | {"range_m": range_m, "intensity_counts": intensity, "saturated": saturated}


def _count_by_light(photons: np.ndarray, counts: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the counts of light by the mean counts of pixels of similar light; in proportion to it beyond them.

    Parameters
    ----------
    photons, counts : (report) of the reports of a frame.
    wanted : (pixel) photons.
    """
    if not len(photons):
        return np.ones(len(wanted))
    order = np.argsort(photons, kind="stable")
    edges = np.arange(0, len(order), _BIN)
    size = np.diff(np.append(edges, len(order)))
    level = np.add.reduceat(photons[order].astype(float), edges) / size
    mean = np.add.reduceat(counts[order].astype(float), edges) / size
    found = np.interp(wanted, level, mean)
    dim, bright = wanted < level[0], wanted > level[-1]
    found[dim] = mean[0] * wanted[dim] / level[0]
    found[bright] = mean[-1] * wanted[bright] / level[-1]
    if len(photons) > _BIN:
        found = np.minimum(found, max(float(counts.max()), 1.0))
    return np.asarray(found)


@dataclass(frozen=True)
class LowerEnergy:
    """Lower the energy of the pulse by a random factor: change the labels of light, then draw the noise again.

    The factor is log-uniform from `least` to 1. Photons fall by it, and the probability and the deviation of each pixel as
    the split says that they depend on photons: by the means of its frames, in the normal deviate of the probability. Where
    a pixel differs from the mean, such as by its threshold, it keeps the difference. Light that no frame has is taken as
    the nearest. Its own noise is drawn by `RedrawNoise`, which it includes.

    Parameters
    ----------
    photons, normal, sigma_m : (level) the mean curve: photons, the standard normal deviate of the probability, and the
        deviation [m]. `of` measures them.
    least : smallest factor.
    redraw : draws the noise.
    """

    photons: tuple[float, ...]
    normal: tuple[float, ...]
    sigma_m: tuple[float, ...]
    least: float = 0.3
    redraw: RedrawNoise = RedrawNoise()
    needs: tuple[str, ...] = RedrawNoise.needs

    @classmethod
    def of(cls, split: Split, least: float = 0.3, *, frames: int = 200, sensor: int = 0) -> LowerEnergy:
        """Measure the curve of a split.

        Parameters
        ----------
        split : of the training.
        least : smallest factor.

        Other Parameters
        ----------------
        frames : about how many frames, spread over the split, are read.
        sensor : number of the sensor; others have other curves.

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
        found = split.read(own, ("photons", "detection_probability", "range_sigma_m")) if len(own) else {}
        lit = np.isfinite(found["range_sigma_m"]) & (found["photons"] > 0.0) if found else np.zeros(0, bool)
        if not lit.any():
            raise DatasetError(f"{split!r}: no frame of sensor {sensor} has light; choose another sensor")
        photons, probability, sigma_m = (found[name][lit].astype(float) for name in found)
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

    That is another roll of the lidar: exact for a square array whose boresight passes through its middle, and refused for
    any other. The Earth's shadow and the camera's fixed pattern do not turn with it.
    """

    needs: tuple[str, ...] = ("intrinsics_px",)

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the turned frame."""
        _check_centred(frame)
        return turn_frame(frame, int(rng.integers(4)))


@dataclass(frozen=True)
class MirrorImages:
    """Mirror half of the frames from left to right, with position, box and direction of the Sun.

    A mirrored craft has the other handedness. It is another craft unless it has a plane of symmetry, and its attitude is no
    rotation. So an attitude beside it is refused: leave `quaternion_xyzw` out of the fields.
    """

    needs: tuple[str, ...] = ("intrinsics_px",)

    def check_fields(self, fields: tuple[str, ...]) -> None:
        """Refuse an attitude among the fields.

        Parameters
        ----------
        fields : names of the arrays.

        Raises
        ------
        DatasetError : if there is one.
        """
        if "quaternion_xyzw" in fields:
            raise DatasetError(
                "MirrorImages: a mirrored craft has no attitude, which is a rotation; leave out quaternion_xyzw, or this"
            )

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the frame or its mirror image."""
        self.check_fields(tuple(frame))
        _check_centred(frame)
        return mirror_frame(frame) if rng.random() < 0.5 else frame


def turn_frame(frame: dict[str, np.ndarray], turns: int) -> dict[str, np.ndarray]:
    """Turn a frame about the boresight, counterclockwise as seen in the image.

    Parameters
    ----------
    frame : of a square array.
    turns : number of quarter turns.

    Returns
    -------
    The turned frame. The lidar has rolled the other way.
    """
    from scipy.spatial.transform import Rotation

    turned = dict(frame)
    for name in IMAGES:
        if name in frame:
            turned[name] = np.ascontiguousarray(np.rot90(frame[name], turns))
    # In lidar axes x is right and y down. What was right is then up: x to -y.
    turn = Rotation.from_euler("z", -90.0 * turns, degrees=True)
    matrix = np.rint(turn.as_matrix())
    for name in ("position_m", "sun_direction"):
        if name in frame:
            turned[name] = (matrix @ frame[name].astype(float)).astype(frame[name].dtype)
    if "quaternion_xyzw" in frame and np.isfinite(frame["quaternion_xyzw"]).all():
        attitude = turn * Rotation.from_quat(frame["quaternion_xyzw"])
        turned["quaternion_xyzw"] = attitude.as_quat(canonical=True)
    if "box_px" in frame and (frame["box_px"] >= 0).all():
        last = frame["range_m"].shape[0] - 1 if "range_m" in frame else round(2.0 * float(frame["intrinsics_px"][2]))
        first_row, first_col, last_row, last_col = frame["box_px"].tolist()
        for _ in range(turns % 4):
            first_row, first_col, last_row, last_col = last - last_col, first_row, last - first_col, last_row
        turned["box_px"] = np.array([first_row, first_col, last_row, last_col], frame["box_px"].dtype)
    return turned


def mirror_frame(frame: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Mirror a frame from left to right.

    Parameters
    ----------
    frame : without an attitude.
    """
    mirrored = dict(frame)
    for name in IMAGES:
        if name in frame:
            mirrored[name] = np.ascontiguousarray(frame[name][:, ::-1])
    for name in ("position_m", "sun_direction"):
        if name in frame:
            mirrored[name] = frame[name] * np.array([-1, 1, 1], frame[name].dtype)
    if "box_px" in frame and (frame["box_px"] >= 0).all():
        last = frame["range_m"].shape[1] - 1 if "range_m" in frame else round(2.0 * float(frame["intrinsics_px"][2]))
        box = frame["box_px"]
        mirrored["box_px"] = np.array([box[0], last - box[3], box[2], last - box[1]], box.dtype)
    return mirrored


def _check_centred(frame: dict[str, np.ndarray]) -> None:
    """Refuse a frame whose boresight does not pass through the middle of a square array."""
    fx, fy, cx, cy = frame["intrinsics_px"].tolist()
    shapes = {frame[name].shape for name in IMAGES if name in frame and not name.startswith("oversampled")}
    square = all(rows == cols for rows, cols in shapes)
    middle = all(abs(2.0 * c - (rows - 1)) < 2.0 * _CENTRED_PX for rows, _ in shapes for c in (cx, cy))
    if not square or not middle or abs(fx - fy) > 1e-9 * fx:
        raise DatasetError(
            f"augmentation: turns and mirror images need a square array about the boresight, not {sorted(shapes)} with the "
            f"principal point at ({cx:g}, {cy:g}); leave them out"
        )
