"""A thousand dispersed runs of a two-hour approach, over one run, in turns: `python -m benchmarks.dispersions`."""

import time
from pathlib import Path

import numpy as np

import rso_lidar as rl

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "dispersed_hop.toml"


def measure(runs=1000, repeats=5):
    """Return the seconds (repeat) of one run without frames, and of `runs` dispersed ones; each has a seed of its own."""
    one_s, many_s = [], []
    for seed in range(repeats + 1):  # the first is not counted
        scenario = rl.Scenario.load(EXAMPLE, (f"seed={seed}",))
        began = time.perf_counter()
        rl.truth(scenario)
        one_s.append(time.perf_counter() - began)
        began = time.perf_counter()
        rl.study.disperse(scenario.replace(seed=seed + 1000), runs)
        many_s.append(time.perf_counter() - began)
    return np.array(one_s[1:]), np.array(many_s[1:])


def main():
    """Print both times and their ratio."""
    one_s, many_s = measure()
    ratio = many_s / one_s
    print(f"one run, truth of 720 instants  {np.median(one_s):.3f} s")
    print(f"1000 dispersed runs             {np.median(many_s):.3f} s")
    print(f"ratio  {np.median(ratio):.1f} ({ratio.min():.1f} to {ratio.max():.1f}); target 100")


if __name__ == "__main__":
    main()
