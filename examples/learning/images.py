"""The largest bright group in the images of a camera: as crops for networks, and as points for shape features."""

from __future__ import annotations

import numpy as np
from frames import CROP, FRAME_COLUMNS, SMALLEST_RADIUS, Returns, cells, choose_frames, directions
from scipy import ndimage

import rso_lidar as rl
from rso_lidar.errors import DatasetError

CAMERA = "eye"  # name in benchmark_1_scenario.toml
THRESHOLD_SIGMA = 6.0  # of a mean of 3 x 3 pixels: 1e-9 of the dark ones are above it, less than one in 1,000 images
JOIN_PX = 6  # groups with gaps up to twice this are one: a craft in half shadow has several lit parts


def find_bright(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the largest group of bright pixels in an image (row, col) of counts.

    Returns
    -------
    light (row, col) above the background, in standard deviations of the noise of a pixel; and whether each pixel is in the
    group. Both come from the image alone: most of it is sky.
    """
    background = np.median(image)
    noise = max(1.0, 1.4826 * float(np.median(np.abs(image - background))))  # of a normal distribution
    light = ((image - background) / noise).astype(np.float32)
    bright = ndimage.uniform_filter(light, 3) > THRESHOLD_SIGMA / 3.0
    joined, count = ndimage.label(ndimage.binary_dilation(bright, iterations=JOIN_PX))
    if not count:
        return light, bright
    return light, bright & (joined == 1 + np.argmax(np.bincount(joined[bright], minlength=count + 1)[1:]))


def crop_image(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a crop (2, row, col) about the largest bright group, and three numbers that it lacks.

    The channels are the logarithm of light over noise, and 1 in the group. The crop encloses a circle about the group. The
    numbers are the logarithms of its half width [pixels / 10], of the number of bright pixels, and of the brightest.

    Parameters
    ----------
    image : counts (row, col).
    """
    light, bright = find_bright(image)
    out, extra = np.zeros((2, CROP, CROP), np.float32), np.zeros(3, np.float32)
    pixel = np.argwhere(bright)
    if not len(pixel):
        return out, extra
    middle = (pixel.min(axis=0) + pixel.max(axis=0)) / 2.0
    radius = max(SMALLEST_RADIUS, float(np.hypot(*(pixel - middle).T).max()) + 1.0)
    at = np.rint(middle[:, None, None] + radius * cells()).astype(int)
    inside = np.all((at >= 0) & (at < np.array(image.shape)[:, None, None]), axis=0)
    place = tuple(np.where(inside, at, 0))
    out[0] = np.where(inside, np.log1p(np.maximum(light, 0.0))[place] / 5.0, 0.0)
    out[1] = inside & bright[place]
    extra[:] = np.log(radius / 10.0), np.log1p(len(pixel)) / 4.0, np.log1p(light[bright].max()) / 5.0
    return out, extra


def open_images(folder: str, split: str, camera: str) -> tuple[rl.dataset.Split, str]:
    """Open a split, and return it with the name of the array of a camera's images.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    camera : its name.
    """
    part = rl.dataset.open(folder).split(split)
    name = f"camera.{camera}.intensity_counts"
    if name not in part.names:
        raise DatasetError(f"{folder}: {split}: has no images of a camera {camera!r}: add [[camera]] to its scenario")
    return part, name


def load_image_crops(folder: str, split: str, camera: str, most: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Load crops (frame, 2, row, col) and their numbers (frame, 3) of the images of a camera.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    camera : its name. The first band is taken.
    most : greatest number of frames; all if omitted.
    """
    part, name = open_images(folder, split, camera)
    taken = choose_frames(part, most, None)
    crops = [
        crop_image(image[..., 0].astype(np.float32))
        for rows in np.array_split(taken, 1 + len(taken) // 64)
        for image in part.read(rows.tolist(), (name,))[name]
    ]
    return np.stack([crop for crop, _ in crops]), np.stack([extra for _, extra in crops])


def load_bright_points(
    folder: str,
    split: str,
    camera: str,
    range_m: np.ndarray | None = None,
    most: int | None = None,
    draws: int | None = None,
) -> Returns:
    """Load the bright group of each image as points at one range, in the form of the returns of a lidar.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    camera : its name. The first band is taken.
    range_m : (frame) of the points; 1 km if omitted, because a camera alone does not know it.
    most, draws : as for `load_returns`, whose frames these are.
    """
    part, name = open_images(folder, split, camera)
    taken = choose_frames(part, most, draws)
    columns = {column: np.asarray(part.column(column))[taken] for column in FRAME_COLUMNS}
    columns["intrinsics_px"] = np.asarray(part.column(f"camera.{camera}.intrinsics_px"))[taken]
    far = np.full(len(taken), 1000.0) if range_m is None else range_m
    points, pixels, lights = [], [], []
    for places in np.array_split(np.arange(len(taken)), 1 + len(taken) // 64):
        for k, image in zip(places.tolist(), part.read(taken[places].tolist(), (name,))[name], strict=True):
            light, bright = find_bright(image[..., 0].astype(np.float32))
            sight = directions(bright.shape, columns["intrinsics_px"][k])
            points.append((far[k] * sight[bright]).astype(np.float32))
            pixels.append(np.argwhere(bright).astype(np.int16))
            lights.append(np.maximum(light[bright], 0.01))
    count = np.array([len(some) for some in points])
    return Returns(
        start=np.concatenate([[0], np.cumsum(count)]),
        point_m=np.concatenate(points),
        pixel=np.concatenate(pixels),
        intensity=np.concatenate(lights),
        reports=count,
        columns=columns,
    )


def load_camera_poses(folder: str, split: str, camera: str, most: int | None = None) -> dict[str, np.ndarray]:
    """Load `position_m` (frame, 3) and `quaternion_xyzw` (frame, 4) of the target in the axes of a camera.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    camera : its name.
    most : as for `load_returns`, whose frames these are.
    """
    part, _ = open_images(folder, split, camera)
    taken = choose_frames(part, most, None)
    return {
        name: np.asarray(part.column(f"camera.{camera}.{name}"))[taken] for name in ("position_m", "quaternion_xyzw")
    }
