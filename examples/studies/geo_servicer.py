"""Read the approach of examples/geo_servicer.toml: burns, frames by range, and two hundred flights with a filter.

`python examples/studies/geo_servicer.py` prints the tables of geo_servicer.md and draws its picture, in a minute and a half.
"""

import sys
from pathlib import Path

import numpy as np

import rso_lidar as rl
from rso_lidar.picture import save_figure

HERE = Path(__file__).resolve().parent
INSTANTS_H = (0.0, 9.8, 12.0, 14.6, 18.7, 18.9, 22.0, 24.9)
BANDS_M = ((0, 20), (20, 60), (60, 450), (450, 3100), (3100, 10_000), (10_000, 20_100))


def main(picture: Path) -> None:
    """Print the tables, and draw the picture."""
    scenario = rl.Scenario.load(HERE.parent / "geo_servicer.toml")
    flight = scenario.follower.motion.fly(scenario.time.start_utc, scenario.target[0].motion)
    print(flight.plan.describe())
    seen = None
    for one in flight.list_estimates(scenario.time.duration_s):
        if one.sensors != seen:
            names = [
                sensor.type for k, sensor in enumerate(scenario.follower.motion.navigation.sensors) if k in one.sensors
            ]
            away_m = np.linalg.norm(one.position_m)
            print(f"{one.time_s / 3600.0:5.2f} h  {away_m:7.0f} m  {' and '.join(names) or 'no sensor'}")
            seen = one.sensors
    burns = sum(one.size_m_s for one in flight.list_commands(scenario.time.duration_s))
    print(f"burns: planned {flight.plan.impulsive_delta_v_m_s:.3f} m/s, flown {burns:.3f} m/s")
    truth = rl.truth(scenario)
    view = truth.pose("lidar", "client").translation
    rows = []
    for frame in rl.simulate(scenario):
        right = frame.valid & (frame.labels.target == 0)
        error = np.abs(frame.range_m - frame.labels.range_m)[right]
        rows.append((right.sum(), np.median(error) if right.sum() >= 10 else np.nan))
    returns, error = np.array(rows, dtype=float).T
    range_m = np.linalg.norm(view, axis=1)
    for low, high in BANDS_M:
        here = (range_m >= low) & (range_m < high)
        known = error[here & np.isfinite(error)]
        print(
            f"{low:6} to {high:6} m  {here.sum():3} frames, 10 returns or more in {np.mean(returns[here] >= 10):4.0%}, "
            f"median {np.median(returns[here]):7.0f}, error {np.median(known) if len(known) else np.nan:.3f} m"
        )
    made = rl.study.disperse(scenario, 200)
    print(made.describe())
    for at_h in INSTANTS_H:
        k = int(np.argmin(np.abs(made.tubes["time_s"] - 3600.0 * at_h)))
        errors = ", ".join(f"{made.tubes[f'{axis}_knowledge_sigma_m'][k]:.3g}" for axis in ("radial", "along", "cross"))
        print(f"{at_h:5.1f} h  {made.tubes['range_p50_m'][k]:7.0f} m  error of the filter {errors} m")
    save_figure(made.figure(), picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "geo_servicer.png")
