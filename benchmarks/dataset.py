"""The dataset of Fuller et al.: seven craft at 400 ranges each, from 3 km down to filling the field, in all attitudes."""

import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.clock import seconds
from benchmarks.report import Findings, Target, table
from rso_lidar import units

FRAMES = 2800
FARTHEST_M = 3000.0
WANTED = 150.0  # frames/s


def approach(name: str, frames: int, folder: Path) -> tuple[rl.Scenario, float]:
    """Return a scenario in which a craft tumbles nearer in even steps, and the range [m] at which it fills the field."""
    model = scenes.mesh(name)
    still = scenes.scenario(name, [scenes.target(name, model, rl.Fixed(position_m=(FARTHEST_M, 0.0, 0.0)))], 1)
    widest_m = float(np.ptp(still.surfaces[0].corners.reshape(-1, 3), axis=0).max())
    nearest_m = 0.5 * widest_m / math.tan(0.5 * scenes.FOV_DEG * units.DEG)
    path = folder / f"{name}.csv"
    path.write_text(f"time_s,x_m,y_m,z_m\n0,{FARTHEST_M},0,0\n{frames - 1},{nearest_m},0,0\n")
    tumble = rl.Tumble(inertia_kg_m2=(1000.0, 1700.0, 2200.0), body_rate_deg_s=(31.0, 53.0, 17.0))
    moving = scenes.target(name, model, rl.motion.Table(file=str(path)), tumble)
    return scenes.scenario(name, [moving], frames), nearest_m


WAYS: dict[str, dict[str, Any]] = {"2 threads": {"threads": 2}, "2 workers": {"workers": 2}}


def run(*, quick: bool) -> Findings:
    """Return how fast the dataset is made and written, craft by craft and in all."""
    names = scenes.craft()
    frames = FRAMES // len(names) // (10 if quick else 1)
    took: dict[str, list[float]] = {way: [] for way in WAYS}
    sizes, rows = [], []
    with tempfile.TemporaryDirectory() as kept:
        folder = Path(kept)
        for name in names:
            print(f"dataset: {name}", file=sys.stderr)
            scenario, nearest_m = approach(name, frames, folder)
            file = folder / f"{name}.h5"
            for way, how in WAYS.items():
                took[way].append(seconds(lambda: rl.save(file, rl.simulate(scenario, **how), overwrite=True)))
            sizes.append(file.stat().st_size / 1e6)
            file.unlink()
            rates = [f"{frames / spans[-1]:.0f}" for spans in took.values()]
            rows.append((name, f"{len(scenario.surfaces[0].facets):,}", f"{nearest_m:.0f}", *rates, f"{sizes[-1]:.1f}"))
    total = frames * len(names)
    rates = {way: total / sum(spans) for way, spans in took.items()}
    whole = [f"**{rate:.0f}**" for rate in rates.values()]
    rows.append((f"all {total:,} frames", "", "", *whole, f"{sum(sizes):.1f}"))
    header = ("craft", "facets", "nearest [m]", *(f"frames/s, {way}" for way in rates), "file [MB]")
    fastest = max(rates, key=lambda way: rates[way])
    said = (
        f"With {fastest} {sum(sizes) / sum(took[fastest]):.1f} MB/s go to disk, "
        f"{sum(sizes) / total * 1e3:.0f} kB a frame."
    )
    measured = f"{rates[fastest]:.0f} frames/s with {fastest}"
    target = Target(
        f"the dataset of Fuller et al., {FRAMES:,} frames of {len(names)} craft, on disk",
        f"at least {WANTED:g} frames/s",
        measured,
        rates[fastest] >= WANTED,
    )
    return Findings({"dataset": f"{table(header, rows)}\n\n{said}"}, [target])
