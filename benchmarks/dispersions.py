"""A thousand dispersed runs of a two-hour approach, over one run, in turns: `python -m benchmarks.dispersions`.

Both without and with a navigation filter that measures each minute by a camera and a lidar.
"""

import time
from pathlib import Path

import numpy as np

import rso_lidar as rl
from rso_lidar import rpo

FILTER = rpo.RelativeFilter(
    every_s=60,
    sensors=(
        rpo.NavigationCamera(bearing_sigma_deg=0.01, needs_sunlight=False),
        rpo.NavigationLidar(bearing_sigma_deg=0.02, range_sigma_m=0.1, most_range_m=1500),
    ),
    position_sigma_m=(50, 100, 50),
    velocity_sigma_m_s=(0.02, 0.02, 0.02),
)
EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "dispersed_hop.toml"


def measure(runs=1000, repeats=5, navigation=None):
    """Return the seconds (repeat) of one run without frames, and of `runs` dispersed ones; each has a seed of its own.

    `navigation` takes the place of that of the example.
    """
    one_s, many_s = [], []
    for seed in range(repeats + 1):  # the first is not counted
        scenario = rl.Scenario.load(EXAMPLE, (f"seed={seed}",))
        if navigation is not None:
            motion = scenario.follower.motion.replace(navigation=navigation)
            scenario = scenario.replace(follower=scenario.follower.replace(motion=motion))
        began = time.perf_counter()
        rl.truth(scenario)
        one_s.append(time.perf_counter() - began)
        began = time.perf_counter()
        rl.study.disperse(scenario.replace(seed=seed + 1000), runs)
        many_s.append(time.perf_counter() - began)
    return np.array(one_s[1:]), np.array(many_s[1:])


def main():
    """Print both times and their ratio, without and with a filter."""
    for name, navigation in (("stated errors", None), ("filter", FILTER)):
        one_s, many_s = measure(navigation=navigation)
        ratio = many_s / one_s
        print(f"{name}: one run, truth of 720 instants  {np.median(one_s):.3f} s")
        print(f"{name}: 1000 dispersed runs             {np.median(many_s):.3f} s")
        print(f"{name}: ratio  {np.median(ratio):.1f} ({ratio.min():.1f} to {ratio.max():.1f}); target 100")


if __name__ == "__main__":
    main()
