"""Classify and detect by shape features of the returns, in metres, with random forests (scikit-learn).

`python examples/learning/shape.py FOLDER -o shape.npz`; with `--floor`, by the number of returns and the range only. Other
classifiers have to beat that floor, which shows how much a dataset reveals without the shape.

With `--sensor camera`, the features are those of the bright pixels of a camera's image, in angles. With `--sensor both`,
they are in metres, by the lidar's range, and stand beside those of the returns. `--runs 5` writes five files, and
`--also OTHER` predicts another dataset.
"""

from pathlib import Path
from typing import Any

import numpy as np
from arguments import parse, run
from frames import Returns, load_returns
from images import CAMERA, load_bright_points
from predictions import accuracy, write

INTENSITY = (3, 4, 5, 6, 7)  # features of brightness among those of `measure_shape`


def measure_floor(returns: Returns) -> np.ndarray:
    """Return the logarithms of the count of returns and of their median range (frame, 2)."""
    far = [
        np.median(np.linalg.norm(returns.point_m[returns.of(k)], axis=1)) if n else 1.0
        for k, n in enumerate(returns.count)
    ]
    return np.log(np.stack([returns.count + 1.0, np.array(far)], axis=1))


def measure_shape(returns: Returns) -> np.ndarray:
    """Return shape features (frame, feature) of the returns of each frame; NaN where there are too few.

    Extents along the principal axes, their moments, how far the points are from planes and lines, radial distribution,
    area in pixels and in square metres, and the statistics of intensity.
    """
    pixel_rad = 1.0 / returns.columns["intrinsics_px"][:, 0]
    return np.array([_measure(returns, k, float(pixel_rad[k])) for k in range(len(returns))], np.float32)


def _measure(returns: Returns, frame: int, pixel_rad: float) -> np.ndarray:
    point = returns.point_m[returns.of(frame)].astype(float)
    out = np.full(40, np.nan)
    count = len(point)
    out[0] = count
    if not count:
        return out
    far = np.linalg.norm(point, axis=1)
    side = float(np.median(far)) * pixel_rad
    # Photons that a facing facet of the same reflectance sends back fall with the square of range.
    bright = returns.intensity[returns.of(frame)] * (np.median(far) / 1000.0) ** 2
    out[1:4] = count * side**2, side, np.median(bright)
    out[4:8] = bright.std(), *np.quantile(bright, [0.1, 0.9]), bright.sum()
    if count < 3:
        return out
    off = point - point.mean(axis=0)
    for first, data in ((8, off), (18, off[:, :2])):  # in space, and across the line of sight
        values, axes = np.linalg.eigh(data.T @ data / count)
        along = data @ axes[:, ::-1]
        n = data.shape[1]
        spread = np.sqrt(np.maximum(values[::-1], 0.0))
        out[first : first + n] = spread
        out[first + n : first + 2 * n] = along.max(axis=0) - along.min(axis=0)
        out[first + 2 * n] = spread[1] / max(spread[0], 1e-6)
        out[first + 2 * n + 1] = np.abs((along[:, 0] ** 3).mean()) / max(spread[0] ** 3, 1e-6)
        out[first + 2 * n + 2] = (along[:, 0] ** 4).mean() / max(spread[0] ** 4, 1e-6)
    out[17] = spread_of_plane(off)
    across = np.hypot(*off[:, :2].T)
    out[25:30] = np.quantile(across, [0.1, 0.3, 0.5, 0.7, 0.9])
    along = off[:, :2] @ np.linalg.eigh(off[:, :2].T @ off[:, :2])[1][:, ::-1]
    box = np.ptp(along, axis=0) + side
    out[30] = count * side**2 / box.prod()
    # How wide the craft is along its long axis: eight strips, from the wider half to the other.
    edges = np.linspace(-0.5, 0.5, 9) * box[0] + (along[:, 0].max() + along[:, 0].min()) / 2.0
    strips = np.histogram(along[:, 0], edges)[0] / count
    strips = strips if strips[:4].sum() >= strips[4:].sum() else strips[::-1]
    out[31:39] = strips
    out[39] = np.corrcoef(np.hypot(*off[:, :2].T), off[:, 2])[0, 1] if count > 3 else np.nan
    return out


def spread_of_plane(off: np.ndarray) -> float:
    """Return the rms distance of points from the plane that fits them best [m]."""
    return float(np.sqrt(max(0.0, np.linalg.eigvalsh(off.T @ off / len(off))[0])))


def classifier(seed: int) -> Any:
    """Return an untrained forest that takes features with NaN; trees need no scaling, and each has a random state."""
    from sklearn.ensemble import ExtraTreesClassifier
    from sklearn.impute import SimpleImputer
    from sklearn.pipeline import make_pipeline

    forest = ExtraTreesClassifier(400, min_samples_leaf=2, random_state=seed)
    return make_pipeline(SimpleImputer(strategy="constant", fill_value=-1.0, keep_empty_features=True), forest)


def floor_classifier() -> Any:
    """Return an untrained logistic regression of scaled features."""
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000))


def measure(folder: str, split: str, sensor: str, most: int | None, draws: int | None) -> tuple[Returns, np.ndarray]:
    """Load the frames of a split, and return them with the features (frame, feature) of a sensor.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    sensor : lidar, camera or both.
    most, draws : greatest number of frames, and of noise draws of a pose; all if None.
    """
    returns = load_returns(folder, split, most=most, draws=draws)
    if sensor == "lidar":
        return returns, measure_shape(returns)
    if sensor == "camera":
        return returns, measure_shape(load_bright_points(folder, split, CAMERA, most=most, draws=draws))
    lidar = measure_shape(returns)
    range_m = np.array(
        [
            np.linalg.norm(returns.point_m[returns.of(k)], axis=1).mean() if n else 1000.0
            for k, n in enumerate(returns.count)
        ]
    )
    camera = measure_shape(load_bright_points(folder, split, CAMERA, range_m, most, draws))
    return returns, np.concatenate([lidar, camera], axis=1)


def main() -> None:
    options = parse(__doc__, flags=("floor",), draws=True, runs=True, sensors=("lidar", "camera", "both"))
    path, most = Path(options.output), options.most
    if options.floor:
        returns = load_returns(options.dataset, "train", most=most, draws=options.draws)
        features, made = measure_floor(returns), returns.has_craft
        tests = {folder: load_returns(folder, "test", most=most) for folder in (options.dataset, *options.also)}
        inputs = {folder: measure_floor(frames) for folder, frames in tests.items()}
    else:
        returns, features = measure(options.dataset, "train", options.sensor, most, options.draws)
        made = (features[:, ::40] > 0).any(axis=1) & (
            returns.columns["class_id"] >= 0
        )  # a count is the first of 40 features
        tests, inputs = {}, {}
        for folder in (options.dataset, *options.also):
            tests[folder], inputs[folder] = measure(folder, "test", options.sensor, most, None)
    present = returns.columns["present"] > 0
    for seed in range(options.seed, options.seed + options.runs):
        model = floor_classifier() if options.floor else classifier(seed)
        model.fit(features[made], returns.columns["class_id"][made])
        detector = None if options.floor or present.all() else classifier(seed).fit(features, present)
        place = path if options.runs == 1 else path.with_stem(f"{path.stem}_{seed}")
        for folder, test in tests.items():
            predicted = {"scores": model.predict_proba(inputs[folder])}
            if detector is not None:
                predicted["present"] = detector.predict_proba(inputs[folder])[:, 1]
            print(accuracy(test, predicted["scores"]))
            name = place if folder == options.dataset else place.with_stem(f"{place.stem}_{Path(folder).name}")
            write(str(name), folder, test, **predicted)


if __name__ == "__main__":
    run(main)
