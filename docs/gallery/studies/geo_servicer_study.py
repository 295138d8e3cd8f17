"""
How far do two hundred approaches spread?
=========================================

The mission of `examples/geo_servicer.toml`, flown with errors of the start, of burns and of navigation. The script is
`examples/studies/geo_servicer.py`, and its text `examples/studies/geo_servicer.md`.
"""

import rso_lidar as rl

made = rl.study.disperse(rl.Scenario.load("examples/geo_servicer.toml"), runs=200)
print(made.describe())

# %%
# Deviations over 25 hours. What is left at the end comes from navigation.
made.figure()

# %%
# **To try.** Correct more often: `rso-lidar disperse examples/geo_servicer.toml --set follower.motion.guidance.every_s=600`.
