"""
How do I get the same frames again?
===================================

Frame *k* depends on the scenario, the seed and *k* only: not on the frames before, on threads or on processes.
"""

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario.load("examples/tumbling_inspection.toml")
alone = next(rl.simulate(scenario, frames=[3], threads=1))
among_others = list(rl.simulate(scenario, frames=range(5), threads=2))[3]
print("same bits:", np.array_equal(alone.range_m, among_others.range_m, equal_nan=True))

# %%
# Another seed gives other noise in the same scene. The labels, which have no noise, stay.
other = next(rl.simulate(scenario.with_seed(1), frames=[3]))
print("same noise:", np.array_equal(alone.range_m, other.range_m, equal_nan=True))
print("same labels:", np.array_equal(alone.labels.photons, other.labels.photons, equal_nan=True))

# %%
# Every frame and every recording carries what it was made from: the scenario in full, seed, versions, and hashes of
# the meshes.
again = rl.Scenario.loads(alone.source.scenario)
repeated = next(rl.simulate(again, frames=[3]))
print("same bits from the source:", np.array_equal(alone.range_m, repeated.range_m, equal_nan=True))
print(alone.source.seed, alone.source.targets[0].mesh_sha256[:12])

# %%
# On another processor or with other library versions, frames agree statistically: :doc:`/compatibility`.
