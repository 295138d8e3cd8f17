"""
How do I compare two lenses?
============================

Replace the part, keep all else, and use the same seed: the noise is common, and the difference is that of the lens.
"""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/proximity_1570.toml")
receiver = scenario.lidar.receiver
lenses = {
    "sharp": receiver.replace(psf=None, distortion=None),
    "blurred": receiver.replace(psf=rl.optics.GaussianPsf(sigma_um=60)),
}
pictures, frames = [], []
for name, lens in lenses.items():
    variant = scenario.replace(name=f"TDRS at 50 m, {name} lens", lidar=scenario.lidar.replace(receiver=lens))
    frames.append(next(rl.simulate(variant, frames=[30])))
    pictures.append(Image.open(picture.contact_sheet(frames[-1:], folder / f"{name}.png", columns=1, rows=1)))
pictures[0]

# %%
pictures[1]

# %%
# In numbers. At edges a blurred pixel mixes two depths.
for name, frame in zip(lenses, frames, strict=True):
    error_m = np.abs(frame.range_m - frame.labels.range_m)[frame.labels.target >= 0]
    print(
        f"{name:8s} {frame.valid.sum():5d} returns, 90 % of range errors below {np.nanquantile(error_m, 0.9) * 100:.1f} cm"
    )

# %%
# Measured point spreads and Zemax listings can be read: :doc:`/instrument`. Many lenses:
# :doc:`/auto_gallery/studies/trade_lens`.
