"""
How do I get from intensity to reflectance?
===========================================

Intensity is the height of the fitted pulse in ADC counts. Counts are proportional to photons below saturation, and
photons to reflectance times the cosine of incidence over the square of the range.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl

# %%
# Calibrate counts per photon on a bench with a plate of known reflectance, at ranges that give different light.
bench = rl.Scenario.load("examples/bench_plate.toml")
camera = bench.lidar.replace(detector=rl.Gsfl())
photons, counts = [], []
for range_m in (300, 600, 900, 1400, 2000, 2600):
    plate = bench.target[0].replace(motion=rl.Fixed(position_m=(float(range_m), 0.0, 0.0)))
    frame = next(rl.simulate(bench.replace(target=(plate,), lidar=camera), frames=[0]))
    filled = (frame.labels.filled_fraction > 0.999) & frame.valid & ~frame.saturated.astype(bool)
    photons.append(frame.labels.photons[filled].mean())
    counts.append(frame.intensity_counts[filled].mean())
gain = np.sum(np.multiply(photons, counts)) / np.sum(np.square(photons))
figure = Figure(figsize=(7, 4), layout="constrained")
axes = figure.subplots()
axes.loglog(photons, counts, "o", label="bench")
axes.loglog(photons, gain * np.array(photons), "-", label=f"{gain:.4f} counts per photon")
axes.set(xlabel="expected photons", ylabel="intensity [counts]", title="Calibration on a plate")
axes.grid()
axes.legend()
figure

# %%
# Then invert a measurement. The constant follows from the plate, too: photons times range squared over reflectance.
constant = photons[0] * 300.0**2 / 0.30
grey = bench.target[0].replace(material=rl.Lambertian(reflectance=0.12), motion=rl.Fixed(position_m=(500.0, 0.0, 0.0)))
frame = next(rl.simulate(bench.replace(target=(grey,), lidar=camera), frames=[0]))
filled = (frame.labels.filled_fraction > 0.999) & frame.valid
reflectance = frame.intensity_counts[filled] / gain * frame.range_m[filled] ** 2 / constant
print(f"estimated reflectance {reflectance.mean():.3f}, true 0.120")

# %%
# Where it fails: saturated pixels (`frame.saturated`), pixels that the target does not fill, and unknown incidence.
# Equations: :doc:`/physics`; published measurements: :doc:`/calibration`.
