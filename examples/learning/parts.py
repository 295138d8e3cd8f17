"""Predict the common part class of each return with a small U-Net on crops.

`python examples/learning/parts.py FOLDER -o parts.npz`
"""

import numpy as np
from arguments import parse, run
from frames import CROP, Returns, add_metres, crop, divide, load_returns, metric_crop, outline, scale
from networks import UNet
from predictions import write
from pytorch import torch
from training import fit, prepare_torch

import rso_lidar as rl

LABEL = "part_class_id"


def train(returns: Returns, classes: int, epochs: int, seed: int) -> UNet:
    """Train on cells with a return of a target; rare part classes have larger weights.

    Parameters
    ----------
    returns : of the training split, with labels of parts.
    classes : number of part classes.
    epochs, seed : of the training.
    """
    network = UNet(5, classes)
    to_train, held_out = divide(returns, seed, returns.has_craft)
    known = returns.labels[LABEL][returns.labels[LABEL] >= 0]
    share = np.bincount(known, minlength=classes) / len(known)
    weight = torch.tensor(np.where(share > 0, (share + 0.005) ** -0.5, 0.0), dtype=torch.float32)

    def loss(frames: np.ndarray, rng: np.random.Generator | None) -> torch.Tensor:
        image, label = crop(returns, frames, rng, (LABEL,))
        image = add_metres(image, scale(returns, frames))
        truth = torch.as_tensor(label[LABEL].astype(np.int64))
        return torch.nn.functional.cross_entropy(network(torch.as_tensor(image)), truth, weight, ignore_index=-1)

    def validate() -> float:
        parts = np.array_split(held_out, 1 + len(held_out) // 64)
        return float(np.mean([float(loss(frames, None)) for frames in parts]))

    fit(network, loss, to_train, validate, epochs=epochs, seed=seed, rate=3e-3, batch=16)
    return network


@torch.no_grad()
def predict(network: UNet, returns: Returns) -> np.ndarray:
    """Return the part class of every return (return): that of the cell of the crop that it lies in."""
    out = np.full(len(returns.pixel), -1, np.int8)
    for frames in np.array_split(np.arange(len(returns)), 1 + len(returns) // 64):
        best = network(torch.as_tensor(metric_crop(returns, frames)[0])).argmax(dim=1).numpy()
        for k, frame in enumerate(frames):
            middle, radius = outline(returns, frame)
            cell = ((returns.pixel[returns.of(frame)] - middle) / radius + 1.0) / 2.0 * CROP
            row, col = np.clip(cell.astype(int), 0, CROP - 1).T
            out[returns.of(frame)] = best[k, row, col]
    return out


def main() -> None:
    options = prepare_torch(parse(__doc__, epochs=10, draws=True))
    data = rl.dataset.open(options.dataset)
    returns = load_returns(options.dataset, "train", (LABEL,), options.most, options.draws)
    test = load_returns(options.dataset, "test", (LABEL,), options.most)
    network = train(returns, len(data.part_classes), options.epochs, options.seed)
    found = predict(network, test)
    on_target = test.labels[LABEL] >= 0
    print(f"part of {(found == test.labels[LABEL])[on_target].mean():.1%} of {on_target.sum():,} returns named")
    shape = data.split("test").read([0], ["range_m"])["range_m"].shape[1:]
    maps = np.full((len(test), *shape), -1, np.int8)
    maps[(np.repeat(np.arange(len(test)), test.count), *test.pixel.T)] = found
    write(options.output, options.dataset, test, part_class_id=maps)


if __name__ == "__main__":
    run(main)
