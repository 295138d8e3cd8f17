"""Predict whether a target is in the frame, from the number, brightness and extent of the densest group of reports.

Noise makes groups of one or two reports of any brightness. A target makes more reports, at one range.
`python examples/learning/presence.py FOLDER -o presence.npz`, of a dataset with an empty class.
"""

import numpy as np
from arguments import parse, run
from frames import Returns, load_returns
from predictions import write

from rso_lidar.errors import DatasetError


def measure_group(returns: Returns) -> np.ndarray:
    """Return features (frame, feature) of the group of reports of each frame, and of all of its reports."""
    out = np.zeros((len(returns), 6))
    for k in range(len(returns)):
        here = returns.of(k)
        count = here.stop - here.start
        if count:
            far = np.linalg.norm(returns.point_m[here], axis=1)
            bright = returns.intensity[here]
            apart = np.ptp(returns.pixel[here], axis=0).max()
            out[k] = count, bright.max(), bright.sum(), np.ptp(far), apart, 0.0
        out[k, 5] = returns.reports[k] - count
    return np.log1p(out)


def main() -> None:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    options = parse(__doc__)
    train = load_returns(options.dataset, "train", most=options.most)
    test = load_returns(options.dataset, "test", most=options.most)
    if len(np.unique(train.columns["present"] > 0)) < 2:
        raise DatasetError(
            f"{options.dataset}: train: has no frames with, or none without, a target: add an empty class"
        )
    model = make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000))
    model.fit(measure_group(train), train.columns["present"] > 0)
    present = model.predict_proba(measure_group(test))[:, 1]
    counted = (test.columns["present"] == 0) | (test.columns["lit_pixels"] >= 1)
    right = ((present > 0.5) == (test.columns["present"] > 0))[counted].mean()
    print(f"{right:.1%} of {counted.sum():,} frames are right at a probability of 0.5")
    write(options.output, options.dataset, test, present=present)


if __name__ == "__main__":
    run(main)
