"""A camera in a scenario, tables that its bench measured, and the curves file that describes them."""

import numpy as np

from rso_lidar.detector import Empirical

HIDDEN = {"reference_photons": 600.0, "noise_equivalent_photons": 110.0}
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
[lidar]
laser = { pulse_fwhm_ns = 6, wavelength_nm = 905 }
receiver = { fov_deg = 2.5, f_number = 2.8, n_rows = 8, n_cols = 8 }
detector = { type = "empirical", quantum_efficiency = 0.7 }
"""
CURVES = """
version = 1
name = "invented"
what = "A camera that a test invents."
constants = ["reference_photons", "noise_equivalent_photons"]
[[curve]]
quantity = "detection_rate"
file = "rate.csv"
photons = 10000
density = "OD"
value = "hits"
unit = "hits"
trials = "flashes"
"""


def make_table(seed=1, flashes=4000):
    """Return the columns of a detection curve behind filters of some optical densities."""
    density = np.linspace(0.95, 1.6, 12)
    camera = Empirical(quantum_efficiency=0.7, **HIDDEN)
    rate = camera.detection_probability(1e4 * 10.0**-density)
    hits = np.random.Generator(np.random.Philox(seed)).binomial(flashes, rate)
    return {"OD": density, "hits": hits.astype(float), "flashes": np.full(12, float(flashes))}


def write_csv(path, columns):
    """Write columns as CSV."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(repr(cell) for cell in row) for row in rows)]
    path.write_text("\n".join(["# a bench", *lines, ""]), encoding="utf-8")


def write_bench(folder, curves=CURVES, columns=None):
    """Write the scenario, the table and the curves file into a folder."""
    (folder / "bench.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "curves.toml").write_text(curves, encoding="utf-8")
    write_csv(folder / "rate.csv", columns or make_table())
    return folder
