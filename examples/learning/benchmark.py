"""Classify and detect by lidar, by camera, or by both: a ResNet-18 on crops of each, joined before the last layer.

`python examples/learning/benchmark.py FOLDER --sensor both --runs 5 -o both.npz` writes `both_1.npz` to `both_5.npz`, one
for each seed. With `--also OTHER`, which may be given several times, the same networks predict the test split of other
datasets, too, into `both_1_OTHER.npz` and so on.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from arguments import parse, run
from frames import CROP, Returns, divide, load_returns, metric_crop
from images import CAMERA, load_image_crops
from networks import ResNet18
from predictions import accuracy, write
from pytorch import torch
from training import fit, prepare_torch

import rso_lidar as rl

SENSORS = {"lidar": ("lidar",), "camera": ("camera",), "both": ("lidar", "camera")}
FEATURES = 64  # of each sensor, which join
ACROSS = slice(3, 5)  # channels of a crop by lidar that are places down and right
BATCH = 64  # frames of a batch of predictions


@dataclass(frozen=True)
class Crops:
    """Inputs of the network by sensor: crops (frame, channel, row, col) and numbers (frame, extra); and `returns`."""

    returns: Returns
    image: dict[str, torch.Tensor]
    extra: dict[str, torch.Tensor]

    @property
    def seen(self) -> np.ndarray:
        """Frames in which a sensor sees anything (frame)."""
        return np.any([(image != 0).flatten(1).any(dim=1).numpy() for image in self.image.values()], axis=0)


class Network(torch.nn.Module):
    """A ResNet-18 for each sensor, and one layer on the features of all: logits of the classes, and of presence."""

    def __init__(self, crops: Crops, classes: int, width: int) -> None:
        super().__init__()
        self.branch = torch.nn.ModuleDict(
            {
                name: ResNet18(FEATURES, image.shape[1], crops.extra[name].shape[1], width)
                for name, image in crops.image.items()
            }
        )
        self.last = torch.nn.Linear(FEATURES * len(crops.image), classes + 1)

    def forward(self, image: dict[str, torch.Tensor], extra: dict[str, torch.Tensor]) -> torch.Tensor:
        features = [branch(image[name], extra[name]) for name, branch in self.branch.items()]
        return self.last(torch.relu(torch.cat(features, dim=1)))


def load_crops(folder: str, split: str, sensors: tuple[str, ...], size: int = CROP, most: int | None = None) -> Crops:
    """Load the inputs of some sensors.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    sensors : lidar, camera.
    size : rows and columns of a crop; a divisor of 64. Smaller crops hold means of the cells of 64 x 64.
    most : greatest number of frames; all if omitted.
    """
    returns = load_returns(folder, split, most=most)
    inputs = {}
    if "lidar" in sensors:
        inputs["lidar"] = metric_crop(returns, np.arange(len(returns)))
    if "camera" in sensors:
        inputs["camera"] = load_image_crops(folder, split, CAMERA, most)
    # With channels last, convolutions are a quarter faster on a processor.
    image = {
        name: torch.nn.functional.avg_pool2d(torch.as_tensor(pair[0]), CROP // size).to(
            memory_format=torch.channels_last
        )
        for name, pair in inputs.items()
    }
    extra = {name: torch.as_tensor(pair[1]) for name, pair in inputs.items()}
    return Crops(returns, image, extra)


def turn(image: torch.Tensor, rng: np.random.Generator, across: slice | None = None) -> torch.Tensor:
    """Turn each crop (frame, channel, row, col) at random about the line of sight, and mirror half of them.

    Parameters
    ----------
    image : crops.
    rng : random generator.
    across : channels that are places down and right, which turn, too.
    """
    angle, side = rng.uniform(0.0, 2.0 * np.pi, len(image)), rng.choice([-1.0, 1.0], len(image))
    c, s = np.cos(angle), np.sin(angle)
    old_from_new = torch.tensor(np.stack([[c, s * side], [-s, c * side]]), dtype=torch.float32).permute(2, 0, 1)
    # The grid has x, y: right, down.
    affine = torch.cat([old_from_new.flip(1, 2), torch.zeros(len(image), 2, 1)], dim=2)
    grid = torch.nn.functional.affine_grid(affine, list(image.shape), align_corners=False)
    turned = torch.nn.functional.grid_sample(image, grid, mode="nearest", align_corners=False)
    if across is not None:
        turned[:, across] = torch.einsum("nji,njrc->nirc", old_from_new, turned[:, across])
    return turned


def train(crops: Crops, classes: int, epochs: int, seed: int, width: int) -> Network:
    """Train on all frames for presence, and on those with a craft that is seen for its class.

    Parameters
    ----------
    crops : of the training split.
    classes : number of classes.
    epochs, seed : of the training.
    width : of the first stage of each ResNet-18; the original has 64.
    """
    network = Network(crops, classes, width).to(memory_format=torch.channels_last)
    columns = crops.returns.columns
    to_train, held_out = divide(crops.returns, seed, np.ones(len(crops.returns), bool))
    truth = torch.as_tensor(columns["class_id"].astype(np.int64))
    present = torch.as_tensor((columns["present"] > 0).astype(np.float32))
    named = (present > 0) & torch.as_tensor(crops.seen)

    def loss(frames: np.ndarray, rng: np.random.Generator | None) -> torch.Tensor:
        image = {name: every[frames] for name, every in crops.image.items()}
        if rng is not None:
            image = {name: turn(some, rng, ACROSS if name == "lidar" else None) for name, some in image.items()}
        logits = network(image, {name: every[frames] for name, every in crops.extra.items()})
        labels = torch.where(named[frames], truth[frames], -1)
        smooth = 0.05 if rng is not None else 0.0
        return torch.nn.functional.cross_entropy(
            logits[:, :-1], labels, ignore_index=-1, label_smoothing=smooth
        ) + torch.nn.functional.binary_cross_entropy_with_logits(logits[:, -1], present[frames])

    def validate() -> float:
        parts = np.array_split(held_out, 1 + len(held_out) // 256)
        return float(np.mean([float(loss(frames, None)) for frames in parts]))

    fit(network, loss, to_train, validate, epochs=epochs, seed=seed, rate=3e-3, batch=32)
    return network


@torch.no_grad()
def predict(network: Network, crops: Crops) -> tuple[np.ndarray, np.ndarray]:
    """Return the probabilities of the classes (frame, class) and of presence (frame)."""
    logits = torch.cat(
        [
            network(
                {name: every[frames] for name, every in crops.image.items()},
                {name: every[frames] for name, every in crops.extra.items()},
            )
            for frames in np.array_split(np.arange(len(crops.returns)), 1 + len(crops.returns) // BATCH)
        ]
    )
    return logits[:, :-1].softmax(dim=1).numpy(), logits[:, -1].sigmoid().numpy()


def main() -> None:
    options = prepare_torch(parse(__doc__, epochs=30, runs=True, sensors=tuple(SENSORS)))
    sensors, path = SENSORS[options.sensor], Path(options.output)
    size, most = options.size, options.most
    crops = load_crops(options.dataset, "train", sensors, size, most)
    tests = {folder: load_crops(folder, "test", sensors, size, most) for folder in (options.dataset, *options.also)}
    classes = len(rl.dataset.open(options.dataset).classes)
    for seed in range(options.seed, options.seed + options.runs):
        torch.manual_seed(seed)
        network = train(crops, classes, options.epochs, seed, options.width)
        place = path if options.runs == 1 else path.with_stem(f"{path.stem}_{seed}")
        torch.save(network.state_dict(), place.with_suffix(".pt"))
        for folder, test in tests.items():
            scores, present = predict(network, test)
            print(accuracy(test.returns, scores))
            name = place if folder == options.dataset else place.with_stem(f"{place.stem}_{Path(folder).name}")
            write(str(name), folder, test.returns, scores=scores, present=present)


if __name__ == "__main__":
    run(main)
