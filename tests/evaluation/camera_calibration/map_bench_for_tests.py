"""A camera in a scenario, and tables with maps of its pixels and raw shots, which numbers of a generator stand for."""

import numpy as np

SHAPE = (6, 8)
SCENARIO = """
version = 1
name = "bench"
world = { axes = "local" }
time = { start_utc = 2026-03-01T12:00:00Z, duration_s = 1, frame_rate_hz = 1 }
follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
[[target]]
name = "plate"
model = "plate"
motion = { type = "fixed", position_m = [20, 0, 0] }
attitude = { type = "look_at", at = "follower" }
[lidar]
laser = { energy_mj = 1.3e-4, divergence_deg = 0.2 }
receiver = { fov_deg = 0.2, f_number = 2.8, n_rows = 6, n_cols = 8 }
detector = { type = "gsfl", armed_to_m = 100 }
"""
MAPS = """
version = 1
name = "mine"
pixel_constants = ["gain", "t0"]
[[map]]
quantity = "counts_mean"
file = "maps.npz"
value = "counts"
photons = 9000
trials = 400
[[map]]
quantity = "range_mean"
file = "maps.npz"
value = "range"
unit = "cm"
photons = 9000
trials = 400
range_m = 21
"""
SHOTS = """
version = 1
name = "mine"
constants = ["readout.baseline_counts"]
[[waveform]]
file = "shots.npz"
samples = "samples"
sample_ns = 2.38
"""


def make_maps(seed=1):
    """Return gain and t0 [ns] of the pixels, one of which is dead, and what a bench reads of them."""
    rng = np.random.Generator(np.random.Philox(seed))
    gain, t0_ns = 1.0 + 0.1 * rng.standard_normal(SHAPE), 0.5 * rng.standard_normal(SHAPE)
    counts = 333.0 * gain + 0.3 * rng.standard_normal(SHAPE)
    range_cm = 2100.0 + 14.9896 * t0_ns + 0.2 * rng.standard_normal(SHAPE)
    counts[2, 3] = range_cm[2, 3] = np.nan
    return {"gain": gain, "t0_ns": t0_ns, "counts": counts, "range": range_cm}


def write_map_bench(folder, text=MAPS, **changes):
    """Write the scenario, the tables and the curves file into a folder."""
    (folder / "bench.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "curves.toml").write_text(text, encoding="utf-8")
    np.savez(folder / "maps.npz", **(make_maps() | changes))
    samples = np.random.Generator(np.random.Philox(4)).normal(60.0, 5.6, (100, 20)).round()
    np.savez(folder / "shots.npz", **({"samples": samples, "photons": np.zeros(100)} | changes))
    return folder
