"""Read the week of examples/studies/geo_week.toml: the drift, its burns, and the neighbour on the way.

`python examples/studies/geo_week.py picture.png` prints numbers of geo_week.md and draws its picture, in half a minute.
"""

import sys
from pathlib import Path

import numpy as np

import rso_lidar as rl
from rso_lidar.picture import figures, palette, save_figure

HERE = Path(__file__).resolve().parent
DAY_S = 86_400.0
RADIUS_M = 40.0  # two satellites with their arrays: 18 m each, and 4 m
SIGMA_M = (400.0, 1400.0, 900.0)  # rtn: element sets to half a day old (docs/encounters.md)


def rtn_offset(chief: rl.orbit.State, other: rl.orbit.State) -> np.ndarray:
    """Return where another body is in the rtn axes of the chief, (n, 3) [m]."""
    inertial_from_rtn, _ = rl.orbit.rtn_axes(chief.position_m, chief.velocity_m_s)
    return inertial_from_rtn.inv().apply(other.position_m - chief.position_m)


def assess_neighbour(servicer: rl.orbit.Trajectory, neighbour: rl.orbit.Trajectory, epoch: rl.orbit.Epochs) -> None:
    """Print the probability of collision at the closest approach, with both orbits known as element sets are."""
    known = []
    for body in (servicer, neighbour):
        state = body.states(epoch)
        axes = rl.orbit.rtn_axes(state.position_m, state.velocity_m_s)[0].as_matrix()[0]
        covariance = axes @ np.diag(np.square(SIGMA_M)) @ axes.T
        known.append(rl.orbit.UncertainState(state.position_m[0], state.velocity_m_s[0], covariance))
    foster = rl.orbit.foster_probability(*known, RADIUS_M)
    whole = rl.orbit.integrate_collisions(*known, RADIUS_M).probability
    print(f"probability of collision: straight (Foster) {foster:.2g}, curved (in 3-D) {whole:.2g}")


def main(picture: Path) -> None:
    """Print the numbers, and draw the week."""
    scenario = rl.Scenario.load(HERE / "geo_week.toml")
    start_utc = scenario.time.start_utc
    client, neighbour = (target.motion for target in scenario.target)
    servicer = scenario.follower.motion
    time_s = np.arange(0.0, scenario.time.duration_s + 1.0, 600.0)
    epochs = rl.orbit.Epochs(start_utc, time_s)
    chief = client.states(epochs)
    place_m = rtn_offset(chief, servicer.states(epochs))
    beside_m = rtn_offset(chief, neighbour.states(epochs))
    for day in range(8):
        x, y, _ = place_m[144 * day]
        print(f"day {day}: {x / 1e3:6.2f} km up, {y / 1e3:8.2f} km along")
    print(f"drift {(place_m[432, 1] - place_m[0, 1]) / 3e3:.2f} km a day, burns {servicer.delta_v_m_s:.3f} m/s")
    distance_m = np.linalg.norm(place_m - beside_m, axis=1)
    middle_s = time_s[distance_m.argmin()]
    fine_s = np.arange(middle_s - 600.0, middle_s + 600.0)
    fine = rl.orbit.Epochs(start_utc, fine_s)
    away = servicer.states(fine), neighbour.states(fine)
    away_m = np.linalg.norm(away[0].position_m - away[1].position_m, axis=1)
    k = int(away_m.argmin())
    speed_m_s = np.linalg.norm(away[0].velocity_m_s - away[1].velocity_m_s, axis=1)[k]
    print(f"neighbour: {away_m[k]:.0f} m at {fine_s[k] / 3600.0:.2f} h, {speed_m_s:.3f} m/s")
    assess_neighbour(servicer, neighbour, rl.orbit.Epochs(start_utc, fine_s[k : k + 1]))
    figure = figures.new_figure(figures.PAGE_IN, 4.6, "The week of a servicer", "300 km behind its client to 19 km")
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(
        time_s / DAY_S, np.linalg.norm(place_m, axis=1) / 1e3, color=palette.BLUE, lw=figures.LINE_PT, label="client"
    )
    above.plot(time_s / DAY_S, distance_m / 1e3, color=palette.ORANGE, lw=figures.LINE_PT, label="neighbour")
    above.set_yscale("log")
    figures.style_axes(above, y="Range [km]")
    figures.draw_legend(above)
    below.plot(time_s / DAY_S, place_m[:, 0] / 1e3, color=palette.BLUE, lw=figures.LINE_PT, label="servicer")
    below.plot(time_s / DAY_S, beside_m[:, 0] / 1e3, color=palette.ORANGE, lw=figures.LINE_PT, label="neighbour")
    below.set_ylim(-7.5, 9.5)  # room for the legend
    figures.style_axes(below, x="Time [days]", y="Height over the client [km]")
    figures.draw_legend(below)
    save_figure(figure, picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "geo_week.png")
