"""
What two days of inspection cost and show
=========================================

The mission of `examples/envisat_inspection.toml`, with its burns, its light, what each range shows of the
satellite, and five hundred flights with errors. The script is `examples/studies/envisat_inspection.py`, and its text
`examples/studies/envisat_inspection.md`.
"""

import rso_lidar as rl

scenario = rl.Scenario.load("examples/envisat_inspection.toml")
flight = scenario.follower.motion.fly(scenario.time.start_utc, scenario.target[0].motion)
burns = sum(one.size_m_s for one in flight.list_commands(scenario.time.duration_s))
print(f"planned {flight.plan.impulsive_delta_v_m_s:.2f} m/s, flown {burns:.2f} m/s")

# %%
# Errors of the start vanish with the first corrections. What remains comes from navigation.
made = rl.study.disperse(scenario, runs=100)
print(made.describe())
made.figure()

# %%
# **To try.** Halve the errors of navigation, and see what corrections cost then: `rso-lidar disperse
# examples/envisat_inspection.toml --set follower.motion.navigation.velocity_sigma_m_s=0.0005`.
