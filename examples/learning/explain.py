"""Which parts decide? LIME over parts and Grad-CAM of the ResNet-18 classifier, with captum.

LIME (Ribeiro et al. 2016) removes the returns of random parts, runs the network, and fits a linear model: the weight of a
part is what its presence adds to the probability of the true class. Grad-CAM (Selvaraju et al. 2017) maps the cells of a
crop that raise the score of that class. `python examples/learning/explain.py FOLDER resnet.pt -o explain.png`
"""

import argparse
import pickle

import numpy as np
from arguments import run, stop
from frames import CROP, Returns, crop, load_returns, metric_crop
from networks import ResNet18
from pytorch import torch
from resnet import CHANNELS

import rso_lidar as rl
from rso_lidar.picture import colour_maps, figures, palette, save_figure

LABEL = "part_class_id"


def weigh_parts(network: ResNet18, returns: Returns, frame: int, parts: int, samples: int = 96) -> np.ndarray:
    """Return the LIME weight of each part class (part) for the true class of a frame, NaN where it has no return.

    Parameters
    ----------
    network : classifier.
    returns : with labels of parts.
    frame : its number.
    parts : number of part classes.
    samples : number of random choices of parts.
    """
    from captum.attr import Lime

    _, label = crop(returns, np.array([frame]), names=(LABEL,))
    image, extra = map(torch.as_tensor, metric_crop(returns, np.array([frame])))
    present, mask = np.unique(label[LABEL][0], return_inverse=True)  # -1 is the sky and noise

    def probability(batch: torch.Tensor) -> torch.Tensor:
        return network(batch, extra.expand(len(batch), -1)).softmax(dim=1)

    torch.manual_seed(frame)
    weight = Lime(probability).attribute(
        image,
        target=int(returns.columns["class_id"][frame]),
        feature_mask=torch.as_tensor(mask.reshape(1, 1, CROP, CROP)).expand(1, CHANNELS, -1, -1),
        n_samples=samples,
        perturbations_per_eval=32,
        return_input_shape=False,
    )
    out = np.full(parts, np.nan)
    out[present[present >= 0]] = weight.detach().numpy().ravel()[present >= 0]
    return out


def map_attention(network: ResNet18, returns: Returns, frame: int) -> np.ndarray:
    """Return the Grad-CAM map (row, col) of the network's second stage for the true class of a frame, from 0 to 1.

    Parameters
    ----------
    network : classifier.
    returns : of all frames.
    frame : its number.
    """
    from captum.attr import LayerAttribution, LayerGradCam

    image, extra = map(torch.as_tensor, metric_crop(returns, np.array([frame])))
    found = LayerGradCam(network, network.stages[1]).attribute(
        image,
        target=int(returns.columns["class_id"][frame]),
        additional_forward_args=extra,
        relu_attributions=True,
    )
    found = LayerAttribution.interpolate(found, (CROP, CROP), "bilinear")[0, 0].detach().numpy()
    return found / max(float(found.max()), 1e-9)


def draw(path: str, network: ResNet18, returns: Returns, frames: list[int], classes: tuple[str, ...]) -> None:
    """Draw range, Grad-CAM and parts of one frame of each class.

    Parameters
    ----------
    path : of the picture.
    network : classifier.
    returns : with labels of parts.
    frames : their numbers.
    classes : names by number.
    """
    width_in = min(1.9 * len(frames), figures.LANDSCAPE_IN)
    figure = figures.new_figure(width_in, 4.4, "Where a classifier looks", "range, nearer is brighter; below, Grad-CAM")
    axes = figure.subplots(2, len(frames), squeeze=False)
    for k, frame in enumerate(frames):
        image = crop(returns, np.array([frame]))[0]
        ranges = np.where(image[2] > 0, -10.0 * image[0], np.nan)
        axes[0, k].imshow(ranges, cmap=colour_maps.RANGE_RAMP)
        axes[0, k].set_title(
            classes[int(returns.columns["class_id"][frame])], fontsize=figures.HEADING_PT, color=palette.INK
        )
        axes[1, k].imshow(np.where(image[2] > 0, 0.4, 0.0), cmap=colour_maps.INTENSITY_RAMP, vmin=0, vmax=1)
        axes[1, k].imshow(
            map_attention(network, returns, frame), cmap=colour_maps.AMOUNT_RAMP, alpha=0.7, vmin=0, vmax=1
        )
    for axis in axes.flat:
        axis.set_xticks([])
        axis.set_yticks([])
    save_figure(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="folder that `rso-lidar dataset make` wrote")
    parser.add_argument("weights", help="weights that resnet.py wrote")
    parser.add_argument("-o", "--output", default="explain.png", help="picture")
    parser.add_argument("--frames", type=int, default=20, help="number of frames of each class for the table")
    options = parser.parse_args()
    torch.set_num_threads(1)
    data = rl.dataset.open(options.dataset)
    test = load_returns(options.dataset, "test", (LABEL,))
    network = ResNet18(len(data.classes), CHANNELS, extra=2)
    try:
        network.load_state_dict(torch.load(options.weights, weights_only=True))
    except (OSError, RuntimeError, pickle.UnpicklingError):
        stop(f"{options.weights}: has no weights of this network: write them with resnet.py for the same dataset")
    network.eval()
    shown = []
    print("Mean LIME weight of a part where it has returns, as a share of probability; the three heaviest.")
    for k, name in enumerate(data.classes):
        mine = np.flatnonzero((test.columns["class_id"] == k) & (test.columns["draw"] == 0) & (test.count > 100))
        if not len(mine):
            continue
        weight = np.array(
            [weigh_parts(network, test, frame, len(data.part_classes)) for frame in mine[: options.frames]]
        )
        seen = np.isfinite(weight).sum(axis=0)
        mean = np.where(seen >= len(weight) / 4, np.nansum(weight, axis=0) / np.maximum(seen, 1), -np.inf)
        best = [part for part in np.argsort(-mean)[:3] if np.isfinite(mean[part])]
        words = ", ".join(f"{data.part_classes[part]} {mean[part]:+.2f} (in {seen[part]})" for part in best)
        print(f"{name:12} {words} of {len(weight)} frames")
        shown.append(int(mine[np.argmax(test.count[mine])]))
    draw(options.output, network, test, shown, data.classes)


if __name__ == "__main__":
    run(main)
