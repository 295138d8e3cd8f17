"""
How do I find an encounter in a catalogue?
==========================================

Screen a catalogue of element sets against one follower, and make a scenario of an encounter.
"""

import datetime

import rso_lidar as rl

catalog = rl.orbit.Catalog.from_file("tle/flyby.tle")  # put your own catalogue here
start = datetime.datetime(2024, 9, 17, 11, 30, tzinfo=datetime.UTC)
table = rl.study.encounters(catalog, 99003, within_m=20e3, start_utc=start, days=1 / 24)
print(table.table())

# %%
# The first one as a scenario, and its timeline: range, rates, light and pointing.
flyby = rl.Scenario.loads(rl.study.scenario_text(table, 1))
rl.timeline(flyby, every_s=10.0, casts=20).figure()

# %%
# Element sets are good to about a kilometre: such encounters are plausible, not predicted. :doc:`/orbits` says more.
