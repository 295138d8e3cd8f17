"""
How do I run a batch of many scenarios?
=======================================

Fields of a scenario against figures of merit are a trade study, random views for learning are a dataset. Anything
else is a loop over scenarios: `settings` and `replace` change a field, and are checked like the file.
"""

import numpy as np

import rso_lidar as rl

scenarios = [
    rl.Scenario.load("examples/tdrs_approach.toml", (f"lidar.laser.energy_mj={energy}", f"seed={seed}"))
    for energy in (12.5, 25, 50)
    for seed in (1, 2, 3)
]
returns = [next(rl.simulate(scenario, frames=[360])).valid.sum() for scenario in scenarios]
for energy, row in zip((12.5, 25, 50), np.reshape(returns, (3, 3)), strict=True):
    print(f"{energy:5.1f} mJ: {row} returns with three seeds")

# %%
# The same as a study, with a table, a report, processes and a restart after an interruption.
study = rl.study.Study.load("examples/studies/trade_lens.toml").replace(frames=[0], seeds=3, report={"pictures": 0})
energies = rl.trade(study.replace(axis=study.axis[2:])).table
print(energies["lidar.laser.energy_mj"], energies["returns_on_target"], sep="\n")

# %%
# :doc:`/auto_gallery/studies/trade_lens`, :doc:`/auto_gallery/learning/make_a_dataset`, :doc:`/studies`.
