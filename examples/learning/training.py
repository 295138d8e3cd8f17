"""One training loop for all networks here: one-cycle learning rate; the weights of the best epoch are kept."""

from __future__ import annotations

import argparse
import copy
import time
from collections.abc import Callable

import numpy as np
from pytorch import torch


def prepare_torch(options: argparse.Namespace) -> argparse.Namespace:
    """Seed torch and set its number of threads.

    Parameters
    ----------
    options : arguments of a baseline that trains a network.

    Returns
    -------
    the same arguments.
    """
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.threads)
    return options


def fit(
    network: torch.nn.Module,
    loss: Callable[[np.ndarray, np.random.Generator], torch.Tensor],
    frames: np.ndarray,
    validate: Callable[[], float],
    *,
    epochs: int,
    seed: int,
    rate: float = 2e-3,
    batch: int = 64,
) -> float:
    """Train a network in place, and leave it with the weights of the epoch that validated best.

    Parameters
    ----------
    network : to train.
    loss : of a batch of frames, with a generator for its augmentation.
    frames : numbers of those to train on.
    validate : loss on the validation frames.
    epochs, seed, rate, batch : of the training.

    Returns
    -------
    the best validation loss.
    """
    rng = np.random.default_rng(seed)
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=0.02)
    steps = max(1, len(frames) // batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, epochs=epochs, steps_per_epoch=steps)
    best, weights, start = np.inf, copy.deepcopy(network.state_dict()), time.process_time()
    for epoch in range(epochs):
        network.train()
        order = rng.permutation(frames)
        total = 0.0
        for k in range(steps):
            optimizer.zero_grad()
            value = loss(order[k * batch : (k + 1) * batch], rng)
            value.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimizer.step()
            schedule.step()
            total += float(value.detach())
        network.eval()
        with torch.no_grad():
            held_out = validate()
        if held_out < best:
            best, weights = held_out, copy.deepcopy(network.state_dict())
        spent = time.process_time() - start
        print(
            f"epoch {epoch + 1:3d}: loss {total / steps:.4f}, validation {held_out:.4f}, {spent:.0f} s of processor time"
        )
    network.load_state_dict(weights)
    network.eval()
    return best
