"""Labelled datasets: the frames of `rl.dataset.make` beside a plain run over the same views, and random reading."""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.clock import seconds
from benchmarks.report import Findings, Target, table
from rso_lidar.dataset.drawing.plan import DatasetPlan, make_plan
from rso_lidar.dataset.drawing.sample import draw_sample

SPEC = Path(__file__).resolve().parents[1] / "examples" / "learning" / "seven_craft.toml"
WANTED = 0.9  # of the frames of a plain run
RANDOM = 2000  # frames that are read


def spec(each: int, *, prediction: bool) -> rl.dataset.DatasetSpec:
    """Return the shipped dataset of seven craft with `each` frames of every craft, and nothing drawn but the view."""
    whole = rl.dataset.DatasetSpec.load(SPEC)
    classes = [one.replace(samples=each) for one in whole.classes]
    labels = rl.dataset.OptionalLabels(prediction=prediction)
    return whole.replace(classes=classes, draws=1, labels=labels, shard_frames=14)


def plain(plan: DatasetPlan, k: int, folder: Path) -> rl.Scenario:
    """Return a scenario whose frames show the views that the samples of one class were given."""
    mine = np.flatnonzero(plan.membership.target_class == k)
    rows = ["time_s,x_m,y_m,z_m,qx,qy,qz,qw"]
    for time_s, index in enumerate(mine.tolist()):
        target = draw_sample(plan, index).scenario.target[0]
        position, turn = target.motion.position_m, target.attitude.quaternion_xyzw  # type: ignore[union-attr]
        rows.append(",".join(str(x) for x in (time_s, *position, *turn)))
    name = plan.classes[k]
    path = folder / f"{name}.csv"
    path.write_text("\n".join([*rows, ""]))
    target = rl.Target(name=name, model=plan.class_models[k][0], motion=rl.motion.Table(file=str(path)))
    lidar = plan.scenario().lidar
    return scenes.scenario(name, [target], len(mine), lidar)


def run_plain(plan: DatasetPlan, folder: Path) -> float:
    """Return the frames per second of a plain run with two threads, nothing written."""
    scenarios = [plain(plan, k, folder) for k in range(len(plan.classes))]
    for scenario in scenarios:
        list(rl.simulate(scenario, frames=[0, 1], threads=2))  # meshes read, kernels compiled
    took_s = seconds(lambda: [frame.index for scenario in scenarios for frame in rl.simulate(scenario, threads=2)])
    return sum(scenario.time.n_frames for scenario in scenarios) / took_s


def run_labelled(asked: rl.dataset.DatasetSpec, folder: Path) -> float:
    """Return the frames per second of a dataset with two workers, from the first shard's end to the last's."""
    ends: list[float] = []
    made = rl.dataset.make(asked, folder, workers=2, on_shard=lambda done, count: ends.append(time.perf_counter()))
    frames = [record.frames for record in made.records]
    return (sum(frames) - frames[0]) / (ends[-1] - ends[1])


def run(*, quick: bool) -> Findings:
    """Return how fast labelled frames are made, beside a plain run, and read."""
    each = 20 if quick else 80
    rates: list[tuple[str, float]] = []
    with tempfile.TemporaryDirectory() as kept:
        folder = Path(kept)
        print("labelled: plain run", file=sys.stderr)
        before = run_plain(make_plan(spec(each, prediction=False)), folder)
        for name, prediction in (("labels", False), ("labels, with probability and sigma of each pixel", True)):
            print(f"labelled: {name}", file=sys.stderr)
            rates.append((name, run_labelled(spec(each, prediction=prediction), folder / name)))
        print("labelled: plain run again", file=sys.stderr)
        base = 0.5 * (before + run_plain(make_plan(spec(each, prediction=False)), folder))
        split: Any = rl.dataset.open(folder / "labels").split("train")
        order = np.random.default_rng(1).integers(0, len(split), RANDOM)
        read_s = seconds(lambda: [split.read([k], ("range_m", "intensity_counts", "class_id")) for k in order.tolist()])
    rows = [("simulate, two threads, nothing written", f"{base:.0f}", "1")]
    rows += [(f"dataset make, two workers: {name}", f"{rate:.0f}", f"**{rate / base:.2f}**") for name, rate in rates]
    said = (
        f"{7 * each:,} frames of seven craft, each in its own scenario. Reading range, intensity and class of random "
        f"frames, one by one in one process: {RANDOM / read_s:,.0f} frames/s."
    )
    share = rates[0][1] / base
    goal = Target(
        "a labelled dataset, two workers", f"at least {WANTED:g} of simulate", f"{share:.2f}", share >= WANTED
    )
    return Findings({"labelled": f"{table(('what', 'frames/s', 'ratio'), rows)}\n\n{said}"}, [goal])
