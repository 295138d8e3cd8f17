"""Measure what an assumption costs: train on the benchmark, test on frames in which one thing that is assumed differs.

`python examples/learning/gap.py make benchmark_1.toml -o gap` makes test frames once for each change, with the same views,
Suns and clutter. `shape.py` and `benchmark.py` predict them with `--also gap/psf` and so on. Then
`python examples/learning/gap.py table gap lidar_1.npz lidar_2.npz …` compares them with the frames that were not changed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from arguments import run
from study import COLUMNS, load_scores

import rso_lidar as rl
from rso_lidar.dataset import DatasetSpec
from rso_lidar.errors import DatasetError

# What was assumed when the network was trained, and what a real instrument could be instead. Every value is within what
# docs/training_data.md and docs/scenario.md call assumed; spreads are the defaults of their parts.
UNCHANGED, GREY, ALL, SHAPE = "as_trained", "materials", "all", "shape"
WHOLE_SPLIT = 65536  # frames of a shard
CHANGES: dict[str, tuple[str, ...]] = {
    UNCHANGED: (),
    GREY: ("target.craft.material={ type = 'lambertian', reflectance = 0.3 }",),
    "psf": ("lidar.receiver.psf={ type = 'gaussian', sigma_um = 50 }", "camera.eye.lens.psf.sigma_um=6"),
    "threshold": ("lidar.detector.preset=offset_limited", "camera.eye.sensor.read_noise_electrons=16"),
    "jitter": ("lidar.detector.timing.pixel_jitter_ns=0.668",),
    "uneven_pixels": (
        "lidar.detector.maps={}",
        "lidar.detector.defects={}",
        "camera.eye.sensor.response_nonuniformity_fraction=0.05",
    ),
    "crosstalk": ("lidar.detector.crosstalk={}", "lidar.detector.amplitude_crosstalk={}"),
    "sampling": (
        "lidar.receiver.rays_per_pixel=1",
        "lidar.receiver.min_rays_per_target=0",
        "camera.eye.lens.rays_per_pixel=1",
        "camera.eye.has_penumbra=false",
    ),
}


def list_changes() -> dict[str, tuple[str, ...]]:
    """Return the settings of each change, and of all at once."""
    return CHANGES | {ALL: tuple(setting for settings in CHANGES.values() for setting in settings)}


def change(spec: DatasetSpec, settings: tuple[str, ...], samples: int, meshes: Path | None = None) -> DatasetSpec:
    """Return a specification of fewer samples, which are those of the benchmark but for some settings.

    Each split is one shard, so that the test can be made alone.

    Parameters
    ----------
    spec : of the benchmark.
    settings : of the scenario.
    samples : greatest number of each class.
    meshes : folder with STL files in metres, each named like the model that it replaces; None for no replacement.
    """
    classes = []
    for entry in spec.classes:
        models = entry.models
        if meshes is not None and all((meshes / f"{name}.stl").is_file() for name in models):
            models = tuple(str((meshes / f"{name}.stl").resolve()) for name in models)
        classes.append(entry.replace(samples=min(samples, entry.samples), models=models))
    return spec.replace(classes=tuple(classes), set=(*spec.set, *settings), shard_frames=WHOLE_SPLIT)


def make_all(
    spec: DatasetSpec,
    folder: Path,
    samples: int,
    meshes: Path | None,
    *,
    lidar_only: bool = False,
    workers: int | None = None,
) -> None:
    """Make the test split of each change in a folder of its own. One that is complete stays as it is.

    Parameters
    ----------
    spec : of the benchmark.
    folder : of the folders.
    samples : greatest number of each class, of which the test takes its share.
    meshes : folder of meshes for the change of shape; None leaves it out.
    lidar_only : whether images of the camera are left out, which take most of the time.
    workers : number of processes; one per core if None.
    """
    last = ("camera=[]",) if lidar_only else ()
    changed = {name: change(spec, (*settings, *last), samples) for name, settings in list_changes().items()}
    if meshes is not None:
        changed[SHAPE] = change(spec, (*CHANGES[GREY], *last), samples, meshes)
        if not any(name.endswith(".stl") for entry in changed[SHAPE].classes for name in entry.models):
            raise DatasetError(f"{meshes}: has no mesh of a model of the benchmark: name them like tdrs.stl")
    folder.mkdir(parents=True, exist_ok=True)
    for name, other in changed.items():
        place = folder / name
        print(rl.dataset.make(other, place, workers=workers, shards="1:2", resume=place.exists()), flush=True)


def tabulate(folder: Path, files: list[str], min_lit_pixels: int) -> None:
    """Print the accuracy of each change, and its loss against the same frames without the change.

    A frame counts where the unchanged one has enough lit pixels. Losses of the shape are against grey materials, and over
    the craft of which there are other meshes. Their standard error is over frames, of the mean over runs.

    Parameters
    ----------
    folder : of the changes.
    files : predictions of the benchmark, one for each run; those of the changes stand beside them.
    min_lit_pixels : least number of lit pixels.
    """
    right: dict[str, np.ndarray] = {}
    kept: dict[str, np.ndarray] = {}
    for name in (*list_changes(), SHAPE):
        paths = [Path(file).with_stem(f"{Path(file).stem}_{name}") for file in files]
        if not (folder / name).is_dir() or not all(path.is_file() for path in paths):
            print(f"{name}: not predicted")
            continue
        data = rl.dataset.open(folder / name)
        split = data.split("test")
        truth = {column: np.asarray(split.column(column)) for column in (*COLUMNS, "model_id")}
        scores = [load_scores(str(path), truth) for path in paths]
        right[name] = np.stack(scores).argmax(axis=2) == truth["class_id"]
        kept[name] = kept.get(UNCHANGED, (truth["present"] > 0) & (truth["lit_pixels"] >= min_lit_pixels))
        if name == SHAPE:
            is_other = np.array([model.endswith(".stl") for model in data.models])
            kept[name] = kept[name] & is_other[truth["model_id"]]
    if UNCHANGED not in right:
        raise DatasetError(
            f"{folder}: has no predictions of {UNCHANGED}: give --also {folder / UNCHANGED} to a baseline"
        )
    print(f"{'change':16} frames  accuracy         loss, points")
    for name, answers in right.items():
        some = kept[name]
        each = answers[:, some].mean(axis=1)
        base = right[GREY if name == SHAPE and GREY in right else UNCHANGED]
        loss = 100.0 * (base[:, some].mean(axis=0) - answers[:, some].mean(axis=0))
        print(
            f"{name:16} {some.sum():6} {each.mean():7.1%} ± {each.std(ddof=1) if len(each) > 1 else 0.0:.1%} "
            f"{loss.mean():8.1f} ± {loss.std(ddof=1) / np.sqrt(len(loss)):.1f}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="make the frames of all changes")
    make.add_argument("spec", help="specification of the benchmark")
    make.add_argument("-o", "--output", type=Path, required=True, help="folder of the folders")
    make.add_argument("--samples", type=int, default=50, help="greatest number of samples of each class")
    make.add_argument("--meshes", type=Path, help="folder of other meshes of the same craft: NAME.stl, in metres")
    make.add_argument("--lidar-only", action="store_true", help="leave the images of the camera out")
    make.add_argument("--workers", type=int, help="number of processes; one per core if omitted")
    table = commands.add_parser("table", help="print what each change costs")
    table.add_argument("folder", type=Path, help="folder that `make` wrote")
    table.add_argument("predictions", nargs="+", help="predictions of the benchmark, a file for each run")
    table.add_argument(
        "--min-lit-pixels", type=int, default=1, help="least number of lit pixels of a frame that counts"
    )
    options = parser.parse_args()
    if options.command == "make":
        spec = DatasetSpec.load(options.spec)
        make_all(
            spec,
            options.output,
            options.samples,
            options.meshes,
            lidar_only=options.lidar_only,
            workers=options.workers,
        )
    else:
        tabulate(options.folder, options.predictions, options.min_lit_pixels)


if __name__ == "__main__":
    run(main)
