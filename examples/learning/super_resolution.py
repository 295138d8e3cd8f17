"""Make a finer range image from a frame with a small U-Net: where a finer grid has returns, and at what range.

The network gets a patch about the target and corrects the image in which each pixel is repeated. The labels are ranges on
the finer grid of rays that the simulator cast. `python examples/learning/super_resolution.py FOLDER -o fine.npz`, of a
dataset with `oversampled = true`; with `--repeat`, each pixel is repeated, as a baseline for the network.
"""

import numpy as np
from arguments import parse, run
from frames import Returns, divide, load_returns
from networks import UNet
from predictions import write
from pytorch import torch
from training import fit, prepare_torch

import rso_lidar as rl

PATCH = 32  # pixels about the middle of the returns


def find_corner(returns: Returns, frame: int, shape: tuple[int, int]) -> np.ndarray:
    """Return the first row and column of the patch of a frame; it lies inside the frame."""
    pixel = returns.pixel[returns.of(frame)]
    middle = pixel.mean(axis=0) if len(pixel) else np.array(shape) / 2.0
    return np.clip(np.rint(middle).astype(int) - PATCH // 2, 0, np.array(shape) - PATCH)


def make_patch(returns: Returns, frame: int, corner: np.ndarray) -> tuple[np.ndarray, float]:
    """Return a patch (3, row, col) of range about its median [m], log intensity and returns, and the median range [m].

    Parameters
    ----------
    returns : of all frames.
    frame : number of the frame.
    corner : first row and column of the patch.
    """
    out = np.zeros((3, PATCH, PATCH), np.float32)
    here = returns.of(frame)
    at = returns.pixel[here] - corner
    inside = ((at >= 0) & (at < PATCH)).all(axis=1)
    if not inside.any():
        return out, 0.0
    far = np.linalg.norm(returns.point_m[here], axis=1)
    median = float(np.median(far))
    row, col = at[inside].T
    out[:, row, col] = np.stack([far - median, np.log(returns.intensity[here]) / 10.0, np.ones(len(far))])[:, inside]
    return out, median


class Finer(torch.nn.Module):
    """Patches (n, 3, row, col) to corrections of range [m] and logits of a return (n, fine row, fine col) each."""

    def __init__(self, factor: int) -> None:
        super().__init__()
        self.factor, self.net, self.shuffle = factor, UNet(3, 2 * factor**2), torch.nn.PixelShuffle(factor)

    def forward(self, patch: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        out = self.shuffle(self.net(torch.cat([patch[:, :1] / 10.0, patch[:, 1:]], dim=1)))
        coarse = patch[:, 2].repeat_interleave(self.factor, 1).repeat_interleave(self.factor, 2)
        return out[:, 0], out[:, 1] + 4.0 * (coarse - 0.5)  # the network corrects the repeated returns, too


def fill(patch: np.ndarray) -> np.ndarray:
    """Return the range (row, col) of each cell of a patch, or of the nearest cell with a return."""
    from scipy.ndimage import distance_transform_edt

    if not patch[2].any():
        return patch[0]
    row, col = distance_transform_edt(patch[2] == 0, return_distances=False, return_indices=True)
    return patch[0][row, col]


def repeat(values: np.ndarray, factor: int) -> np.ndarray:
    """Return an array with each element of its last two dimensions repeated."""
    return values.repeat(factor, axis=-2).repeat(factor, axis=-1)


class Pairs:
    """Patches of a split, with the ranges of the same area on the finer grid."""

    def __init__(self, folder: str, split: str, most: int | None) -> None:
        self.returns = load_returns(folder, split, most=most)
        part = rl.dataset.open(folder).split(split)
        frames = range(len(self.returns))
        self.shape = part.read([0], ["range_m"])["range_m"].shape[1:]
        self.corner = np.array([find_corner(self.returns, k, self.shape) for k in frames])
        patches = [make_patch(self.returns, k, self.corner[k]) for k in frames]
        self.patch = np.stack([patch for patch, _ in patches])
        self.median_m = np.array([median for _, median in patches])
        self.nearest = np.stack([fill(patch) for patch in self.patch])
        fine = []
        for k in frames:
            truth = part.read([k], ["oversampled_range_m"])["oversampled_range_m"][0]
            self.factor = truth.shape[0] // self.shape[0]
            row, col = self.corner[k] * self.factor
            side = PATCH * self.factor
            fine.append(truth[row : row + side, col : col + side] - self.median_m[k])
        self.fine = np.stack(fine)


def train(pairs: Pairs, epochs: int, seed: int) -> Finer:
    """Train on frames with returns, turned by quarters.

    Parameters
    ----------
    pairs : of the training split.
    epochs, seed : of the training.
    """
    network = Finer(pairs.factor)
    to_train, held_out = divide(pairs.returns, seed, pairs.returns.count > 0)

    def loss(frames: np.ndarray, rng: np.random.Generator | None) -> torch.Tensor:
        turns = 0 if rng is None else int(rng.integers(4))
        patch, near, fine = (
            torch.as_tensor(np.rot90(one[frames], turns, axes=(-2, -1)).copy())
            for one in (pairs.patch, repeat(pairs.nearest, pairs.factor), pairs.fine)
        )
        correction, logit = network(patch)
        there = torch.isfinite(fine)
        off = torch.where(there, near + correction - torch.nan_to_num(fine), 0.0)
        kept = there & (off.abs() < 20.0)
        miss = torch.nn.functional.smooth_l1_loss(off[kept], torch.zeros(int(kept.sum())), beta=0.2)
        return miss + torch.nn.functional.binary_cross_entropy_with_logits(logit, there.float())

    def validate() -> float:
        parts = np.array_split(held_out, 1 + len(held_out) // 64)
        return float(np.mean([float(loss(frames, None)) for frames in parts]))

    fit(network, loss, to_train, validate, epochs=epochs, seed=seed, rate=4e-3, batch=32)
    return network


@torch.no_grad()
def predict(network: Finer | None, pairs: Pairs) -> np.ndarray:
    """Return finer range images (frame, fine row, fine col) [m], NaN where there is no return.

    Parameters
    ----------
    network : None repeats each pixel.
    pairs : of the split to predict.
    """
    rows, cols = (side * pairs.factor for side in pairs.shape)
    out = np.full((len(pairs.returns), rows, cols), np.nan, np.float32)
    for k in np.flatnonzero(pairs.returns.count):
        there = repeat(pairs.patch[k, 2], pairs.factor) > 0
        value = repeat(pairs.nearest[k], pairs.factor)
        if network is not None:
            correction, logit = network(torch.as_tensor(pairs.patch[k : k + 1]))
            there, value = logit[0].numpy() > 0.0, value + correction[0].numpy()
        row, col = pairs.corner[k] * pairs.factor
        out[k, row : row + len(there), col : col + len(there)] = np.where(there, value + pairs.median_m[k], np.nan)
    return out


def main() -> None:
    options = prepare_torch(parse(__doc__, epochs=50, flags=("repeat",)))
    test = Pairs(options.dataset, "test", options.most)
    network = (
        None if options.repeat else train(Pairs(options.dataset, "train", options.most), options.epochs, options.seed)
    )
    found = predict(network, test)
    side, apart, called, there, both = PATCH * test.factor, [], 0, 0, 0
    for k, (row, col) in enumerate(test.corner * test.factor):
        error = found[k, row : row + side, col : col + side] - test.median_m[k] - test.fine[k]
        apart.append(np.abs(error[np.isfinite(error)]))
        called += int(np.isfinite(found[k]).sum())
        there += int(np.isfinite(test.fine[k]).sum())
        both += len(apart[-1])
    median = np.median(np.concatenate(apart))
    print(f"median error {median:.3f} m; silhouettes overlap by {both / (called + there - both):.1%}")
    write(options.output, options.dataset, test.returns, oversampled_range_m=found)


if __name__ == "__main__":
    run(main)
