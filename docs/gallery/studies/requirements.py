"""
Are the requirements met?
=========================

Requirements of a lidar in a file, verified on a scenario with confidence bounds: met, not met, or not shown.
`rso-lidar requirements` does the same, and its exit status tells a continuous integration.
"""

import rso_lidar as rl

requirements = rl.study.Requirements.load("examples/requirements/tdrs_inspection.toml")
for requirement in requirements.requirement:
    print(f"{requirement.id}  {requirement.text}")

# %%
# Those that need no flown frames, so that it takes seconds: closed forms, the timeline, and inspection of the
# parameters.
quick = requirements.replace(
    requirement=tuple(
        one for one in requirements.requirement if one.quantity.startswith(("budget.", "lidar.")) and not one.frames
    )
)
scenario = rl.Scenario.load("examples/tdrs_approach.toml")
matrix = rl.study.verify(quick, scenario)
print(matrix.table())

# %%
# A weaker laser does not meet them any more.
weak = rl.Scenario.load("examples/tdrs_approach.toml", ("lidar.laser.energy_mj=20",))
print(rl.study.verify(quick, weak).table())

# %%
# **To try.** Verify all of them, in about a minute. Save the matrix as CSV, JSON or HTML. How bounds are computed:
# :doc:`/requirements`.
