"""Classify with ResNet-18 on crops of 64 x 64 pixels: range about its median, log intensity, and where there is a return.

`python examples/learning/resnet.py FOLDER -o resnet.npz --seed 1`; the weights are written beside the predictions.
"""

from pathlib import Path

import numpy as np
from arguments import parse, run
from frames import Returns, divide, load_returns, metric_crop
from networks import ResNet18
from predictions import accuracy, write
from pytorch import torch
from training import fit, prepare_torch

import rso_lidar as rl

CHANNELS = 5  # of `metric_crop`


def train(returns: Returns, classes: int, epochs: int, seed: int) -> ResNet18:
    """Train a classifier on frames with returns; 15 % of the samples are held out to choose the epoch.

    Parameters
    ----------
    returns : of the training split.
    classes : number of classes.
    epochs, seed : of the training.
    """
    network = ResNet18(classes, CHANNELS, extra=2)
    to_train, held_out = divide(returns, seed, returns.has_craft)
    truth = torch.as_tensor(returns.columns["class_id"].astype(np.int64))

    def loss(frames: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        logits = network(*map(torch.as_tensor, metric_crop(returns, frames, rng)))
        return torch.nn.functional.cross_entropy(logits, truth[frames], label_smoothing=0.05)

    def validate() -> float:
        scores = torch.as_tensor(predict(network, returns.take(held_out)))
        return float(torch.nn.functional.nll_loss(scores.log(), truth[held_out]))

    fit(network, loss, to_train, validate, epochs=epochs, seed=seed, rate=7e-4, batch=32)
    return network


@torch.no_grad()
def predict(network: ResNet18, returns: Returns) -> np.ndarray:
    """Return the probabilities of the classes (frame, class)."""
    scores = [
        network(*map(torch.as_tensor, metric_crop(returns, frames))).softmax(dim=1)
        for frames in np.array_split(np.arange(len(returns)), max(1, len(returns) // 64))
    ]
    return torch.cat(scores).numpy()


def main() -> None:
    options = prepare_torch(parse(__doc__, epochs=25, draws=True))
    returns = load_returns(options.dataset, "train", most=options.most, draws=options.draws)
    test = load_returns(options.dataset, "test", most=options.most)
    network = train(returns, len(rl.dataset.open(options.dataset).classes), options.epochs, options.seed)
    torch.save(network.state_dict(), Path(options.output).with_suffix(".pt"))
    scores = predict(network, test)
    print(accuracy(test, scores))
    write(options.output, options.dataset, test, scores=scores)


if __name__ == "__main__":
    run(main)
