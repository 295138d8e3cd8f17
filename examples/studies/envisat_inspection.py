"""Read the two days of examples/envisat_inspection.toml: burns, light, frames, what of the satellite was seen, dispersions.

`python examples/studies/envisat_inspection.py` prints the tables of envisat_inspection.md and draws its picture, in some two
minutes on one core.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from rso_lidar.picture import save_figure

HERE = Path(__file__).resolve().parent
SCENARIO = HERE.parent / "envisat_inspection.toml"
STEPS_M = (1.0, 0.5, 0.25)  # widths of a pixel at the satellite


def print_legs(scenario: rl.Scenario) -> None:
    """Print the legs of the plan, and what the flight adds to their delta-v."""
    flight = scenario.follower.motion.fly(scenario.time.start_utc, scenario.target[0].motion)
    for leg in flight.plan.parts:
        end_s = min(leg.end_s, scenario.time.duration_s)
        print(
            f"{leg.name:16} {leg.begin_s / 3600:5.1f} to {end_s / 3600:5.1f} h  {leg.delta_v_m_s:.3f} m/s, "
            f"nearest {leg.nearest_m:,.0f} m"
        )
    burns = sum(one.size_m_s for one in flight.list_commands(scenario.time.duration_s))
    print(f"burns: planned {flight.plan.impulsive_delta_v_m_s:.2f} m/s, flown {burns:.2f} m/s")
    print(f"thrust that holds a path: {flight.plan.delta_v_m_s - flight.plan.impulsive_delta_v_m_s:.2f} m/s")


def read_frames(scenario: rl.Scenario) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return columns (frame) by name, and the finest pixel (facet) [m] at which each facet returned light; inf for none."""
    surface = next(one for one in scenario.surfaces if one.body == "envisat")
    finest = np.full(len(surface.facets), np.inf)
    columns: dict[str, list[float]] = {name: [] for name in ("time_s", "range_m", "returns", "on_target", "error_m")}
    for frame in rl.simulate(scenario, frames=range(57, scenario.time.n_frames)):
        right = frame.valid & (frame.labels.target == 0)
        range_m = float(np.linalg.norm(frame.truth.pose("lidar", "envisat").translation))
        pixel_m = range_m * float(scenario.instrument.at(frame.time_s).receiver.pixel_tangent)
        seen = frame.labels.facet[right]
        np.minimum.at(finest, seen[seen >= 0], pixel_m)
        error = np.abs(frame.range_m - frame.labels.range_m)[right]
        row = (frame.time_s, range_m, frame.valid.sum(), right.sum(), np.median(error) if right.any() else np.nan)
        for name, value in zip(columns, row, strict=True):
            columns[name].append(float(value))
    return {name: np.array(values) for name, values in columns.items()}, finest


def main(picture: Path) -> None:
    """Print the tables, and draw the picture."""
    scenario = rl.Scenario.load(SCENARIO)
    print_legs(scenario)
    truth = rl.truth(scenario)
    print(f"in sunlight {np.mean(truth.sunlit['envisat'] > 0.5):.0%} of the two days")
    table, finest = read_frames(scenario)
    for low, high in ((70, 100), (100, 200), (200, 300), (300, 600), (600, 1000), (1000, 2200)):
        here = (table["range_m"] >= low) & (table["range_m"] < high)
        found = table["on_target"][here] >= 10
        print(
            f"{low:5} to {high:5} m  {here.sum():4} frames, 10 returns or more in {found.mean():4.0%}, "
            f"median {np.median(table['on_target'][here]):6.0f}, error {np.nanmedian(table['error_m'][here]):.3f} m"
        )
    surface = next(one for one in scenario.surfaces if one.body == "envisat")
    area = surface.areas_m2
    for step in STEPS_M:
        print(f"seen with pixels of {step:g} m or less: {area[finest <= step].sum() / area.sum():.0%} of the area")
    made = rl.study.disperse(scenario, 500)
    print(made.describe())
    figure: Any = made.figure()
    save_figure(figure, picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "envisat_inspection.png")
