"""
When can a servicer see its client?
===================================

Light, shadow and Sun over a day of the mission `examples/studies/geo_week.toml`. The script is
`examples/studies/geo_week.py`, and its text `examples/studies/geo_week.md`.
"""

import rso_lidar as rl

scenario = rl.Scenario.load("examples/studies/geo_week.toml")
when = {"shadow": "penumbra or umbra", "lit": "lit", "Sun near": "sun < 30deg"}
table = rl.study.events("examples/studies/geo_week.toml", None, when, start_utc=scenario.time.start_utc, days=1.0)
for row in table.rows:
    print(f"{row.event:9} {row.begin_utc}  {row.duration_s / 60:6.1f} min")

# %%
# Each object has a line for each condition.
table.figure()

# %%
# **To try.** Ask for the whole week: `days=7.0`.
