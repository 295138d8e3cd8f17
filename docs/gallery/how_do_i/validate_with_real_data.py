"""
How do I compare with real data?
================================

Put the numbers of your measurement on a bench, compare distributions and not single pixels, and change one assumed
constant at a time. This page takes a simulated camera with a secret constant as the measurement.
"""

import numpy as np
from scipy import stats

import rso_lidar as rl

bench = rl.Scenario.load("examples/bench_plate.toml", ("target.plate.motion.position_m=[1500, 0, 0]",))


def range_errors(detector, seed):
    """Return the range errors of the pixels that the plate fills [m]."""
    scenario = bench.with_seed(seed).replace(lidar=bench.lidar.replace(detector=detector))
    frames = list(rl.simulate(scenario, frames=range(25)))
    filled = frames[0].labels.filled_fraction > 0.999
    errors = np.concatenate([(frame.range_m - 1500.0)[filled] for frame in frames])
    return errors[np.abs(errors) < 2.0]


measured = range_errors(rl.Empirical(range_plateau_m=0.08), seed=99)  # "the real camera"

# %%
# Candidates for the constant that no data sheet states, and the test of Kolmogorov and Smirnov for each.
for plateau_m in (0.03, 0.05, 0.08, 0.12):
    simulated = range_errors(rl.Empirical(range_plateau_m=plateau_m), seed=1)
    p = stats.ks_2samp(measured - measured.mean(), simulated - simulated.mean()).pvalue
    print(f"plateau {plateau_m:.2f} m: scatter {simulated.std():.3f} m, measured {measured.std():.3f} m, p = {p:.3f}")

# %%
# What has been compared with published cameras, and how near it came: :doc:`/calibration` and :doc:`/validation`.
