"""
A thousand flights of one hop
=============================

A craft hops from 3 km to 200 m behind a spent stage. The start is known as the ground knows it, burns have errors, and so
has navigation. What may happen, and with which probability?
"""

import rso_lidar as rl

scenario = rl.Scenario.load("examples/dispersed_hop.toml")
made = rl.study.disperse(scenario, runs=1000)
print(made.describe())

# %%
# The tubes hold 95 % of the runs. Dashed lines are the linear covariance, which also says what an error comes from.
made.figure()

# %%
# **To try.** Halve the errors of navigation, and see the keep-out sphere entered less often: `rso-lidar disperse
# examples/dispersed_hop.toml --set follower.motion.navigation.velocity_sigma_m_s=0.0015`. More: :doc:`/dispersion`.
