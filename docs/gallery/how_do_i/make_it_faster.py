"""
How do I make it faster?
========================

By default rays sample each pixel until its light is known to 2 %. Fewer rays, a simpler detector and fewer pixels
each save time. Time is measured here on the machine that built this page.
"""

import time

import rso_lidar as rl

scenario = rl.Scenario.load("examples/safety_ellipse.toml")
next(rl.simulate(scenario, frames=[0]))  # the first frame of a process loads the compiled code

variants = {
    "as it is": scenario,
    "light to 5 %": ("lidar.receiver.sampling_error=0.05",),
    "16 rays per pixel": ("lidar.receiver.rays_per_pixel=16",),
    "fast detector": ('lidar.detector={ type = "empirical" }',),
    "both": ("lidar.receiver.rays_per_pixel=16", 'lidar.detector={ type = "empirical" }'),
}
for name, settings in variants.items():
    variant = settings if name == "as it is" else rl.Scenario.load("examples/safety_ellipse.toml", settings)
    start = time.perf_counter()
    frames = list(rl.simulate(variant, frames=range(4)))
    print(
        f"{name:20s} {(time.perf_counter() - start) / len(frames) * 1e3:6.0f} ms a frame, {frames[0].valid.sum()} returns"
    )

# %%
# Tables by stage, and how the cost grows with pixels, facets and range: :doc:`/performance`.
