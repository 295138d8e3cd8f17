"""Draw the first day of examples/studies/leo_week.toml: the safety ellipse in light and shadow.

`python examples/studies/leo_week.py picture.png` takes half a minute.
"""

import sys
from pathlib import Path

import numpy as np

import rso_lidar as rl
from rso_lidar.picture import figures, palette, save_figure

HERE = Path(__file__).resolve().parent


def main(picture: Path) -> None:
    """Draw the path of one day in the rtn axes of the stage, and range and phase angle of its first hours."""
    scenario = rl.Scenario.load(HERE / "leo_week.toml")
    start_utc = scenario.time.start_utc
    stage = scenario.target[0].motion
    time_s = np.arange(0.0, 86_400.0, 60.0)
    epochs = rl.orbit.Epochs(start_utc, time_s)
    position_m, _ = scenario.follower.motion.fly(start_utc, stage).relative(time_s)
    chief = stage.states(epochs)
    inertial_from_rtn, _ = rl.orbit.rtn_axes(chief.position_m, chief.velocity_m_s)
    sun_m = rl.orbit.sun_position_m(epochs)
    toward_sun = inertial_from_rtn.inv().apply(sun_m - chief.position_m)
    toward_sun /= np.linalg.norm(toward_sun, axis=1, keepdims=True)
    range_m = np.linalg.norm(position_m, axis=1)
    phase_deg = np.arccos(np.einsum("ti,ti->t", position_m, toward_sun) / range_m) / rl.units.DEG
    sunlit = rl.orbit.sunlit_fraction(chief.position_m, sun_m) > 0.5
    figure = figures.new_figure(
        figures.PAGE_IN, 3.6, "An inspector in low orbit", "The stage in sunlight and in shadow"
    )
    path, course = figure.subplots(1, 2)
    hours = time_s / 3600.0
    for mask, color, label in ((sunlit, palette.ORANGE, "sunlight"), (~sunlit, palette.BLUE, "shadow")):
        path.plot(position_m[mask, 1], position_m[mask, 0], ".", color=color, ms=2.0, label=label)
        early = mask & (hours < 4.0)
        course.plot(hours[early], phase_deg[early], ".", color=color, ms=3.0, label=label)
    path.set_aspect("equal", adjustable="datalim")
    figures.style_axes(path, x="Along the track [m]", y="Radial [m]")
    figures.draw_legend(path)
    figures.style_axes(course, x="Time [h]", y="Sun, stage, lidar [deg]")
    course.set_ylim(0.0, 90.0)
    print(f"phase angle in sunlight: {phase_deg[sunlit].min():.0f} to {phase_deg[sunlit].max():.0f} deg")
    print(f"range in a day: {range_m.min():.0f} to {range_m.max():.0f} m")
    save_figure(figure, picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "leo_week.png")
