"""
How far can I see?
==================

A link budget in closed form says how far a pixel that the target fills reports it. No frame is simulated.
"""

import rso_lidar as rl

budget = rl.budget("gsfl_1064", materials=["white_paint", 0.3, "black_paint"], tilt_deg=[0, 45])
print(budget.table())

# %%
# Photons, probability of detection and range precision against range.
budget.figure()

# %%
# Curves are arrays, too.
curve = budget.curves[2]
print(f"{curve.material}, tilted by {curve.tilt_deg:.0f} deg: 95 % to {curve.max_range_m:.0f} m")

# %%
# A body that does not fill a pixel is found less far: :doc:`/auto_gallery/how_do_i/cubesat_at_1_km`. A scenario in
# place of the name of a camera takes its target and its materials. Method and errors: :doc:`/studies`.
