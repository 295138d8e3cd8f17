"""Run the reference trackers over a whole approach to a tumbling rocket body, from 2 km to 50 m, and draw their errors.

A spent stage tumbles as its inertia lets it; a follower comes along the V-bar in five hops with a stop after each; a PTU
points. The paper's camera flies it twice: as it is, and with a zoom lens, diffuser and energy that follow the range.
`python examples/studies/tumbling.py` prints tables and draws tumbling.png, in some three minutes; tumbling.md reads them.
"""

import datetime
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from rso_lidar.export import Recording
from rso_lidar.picture import save_figure
from rso_lidar.pose import ROOT
from rso_lidar.scene import model

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
STOPS_M = (2000.0, 1000.0, 500.0, 200.0, 100.0, 50.0)  # behind the stage, on its track
ARRIVALS_S = (0.0, 700.0, 1290.0, 1880.0, 2270.0, 2610.0)
HOLD_S, DURATION_S, RATE_HZ = 90.0, 2700.0, 0.5
BODY_RATE_DEG_S = (0.6, 2.2, 1.0)  # end over end in two and a half minutes
ZOOM = rl.Schedule(
    time_s=ARRIVALS_S,
    focal_length_mm=(293.3, 293.3, 293.3, 100.0, 50.0, 25.0),
    divergence_deg=(2.5, 2.5, 2.5, 7.3, 14.6, 29.0),
    energy_mj=(50.0, 50.0, 30.0, 10.0, 8.0, 5.0),
)
CAMERAS = {"as it is": None, "zoom": ZOOM}
BANDS_M = ((1000.0, 2001.0), (500.0, 1000.0), (200.0, 500.0), (100.0, 200.0), (49.0, 100.0))
APART_S = 10.0  # between two poses that give a rate
RIGHT_RAD = 10.0 * rl.units.DEG  # a turn nearer than that is the right one of those that look alike
AXES = ("right", "down", "ahead")


def scenario(plan: rl.Schedule | None, rate_hz: float = RATE_HZ) -> rl.Scenario:
    """Return the approach, with a camera that follows a plan."""
    stage = model("rocket_body")
    return rl.Scenario(
        version=1,
        name="Approach to a tumbling stage, 2 km to 50 m",
        seed=2050,
        time=rl.Time(start_utc=START, duration_s=DURATION_S, frame_rate_hz=rate_hz),
        target=[
            rl.Target(
                name="stage",
                model="rocket_body",
                motion=rl.Kepler(
                    epoch_utc=START,
                    semi_major_axis_km=6928.137,
                    eccentricity=0.0,
                    inclination_deg=97.6,
                    raan_deg=35.0,
                    argument_of_perigee_deg=0.0,
                    true_anomaly_deg=0.0,
                ),
                attitude=rl.Tumble(inertia_kg_m2=stage.inertia_kg_m2, body_rate_deg_s=BODY_RATE_DEG_S),
            )
        ],
        follower=rl.Follower(
            motion=rl.rpo.Waypoints(
                relative_to="stage",
                positions_m=tuple((0.0, -stop_m, 0.0) for stop_m in STOPS_M),
                times_s=ARRIVALS_S,
                stop=True,
                hold_s=HOLD_S,
            ),
            attitude=rl.Rtn(euler_zyx_deg=(90.0, 0.0, 0.0)),
        ),
        ptu=rl.Ptu(
            point=rl.TrackPoint(at="stage"),
            response=rl.SecondOrder(natural_hz=4.0, damping=0.7, max_rate_deg_s=30.0),
            errors=rl.PointingErrors(jitter_deg=0.002, encoder_noise_deg=0.002),
        ),
        lidar=rl.Lidar(preset="gsfl_1064", schedule=plan),
    )


def flown(plan: rl.Schedule | None, rate_hz: float = RATE_HZ) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Return what the reference trackers make of the approach, from its recording: columns over time, and NIS by filter."""
    with tempfile.TemporaryDirectory() as folder:
        path = rl.save(Path(folder) / "approach.h5", rl.simulate(scenario(plan, rate_hz), threads=1))
        with rl.open(path) as frames:
            made = rl.study.tracking(frames)
            return made.table | _rates(made.table, frames), {name: one.nis_mean for name, one in made.tracks.items()}


def _rates(table: dict[str, np.ndarray], frames: Recording) -> dict[str, np.ndarray]:
    """Return how fast the long axis turns [rad/s] by the poses found, less the truth, over `APART_S`."""
    from scipy.spatial.transform import Rotation

    quaternion = np.stack([table[f"icp_quaternion_{axis}"] for axis in "xyzw"], axis=1)
    found = np.full((len(frames), 3), np.nan)
    true = np.empty((len(frames), 3))
    for k, frame in enumerate(frames):
        true[k] = frame.truth.pose(ROOT, "stage").rotation.as_matrix()[:, 0]  # body +x is the long axis, nearly
        if np.isfinite(quaternion[k]).all():
            turned = frame.truth.pose(ROOT, "lidar").rotation * Rotation.from_quat(quaternion[k])
            found[k] = turned.as_matrix()[:, 0]
    step = max(1, round(APART_S / float(table["time_s"][1] - table["time_s"][0])))
    error = np.full(len(frames), np.nan)
    error[step:] = (_turned(found, step) - _turned(true, step)) / (table["time_s"][step:] - table["time_s"][:-step])
    return {"axis_rate_error_rad_s": error}


def _turned(axis: np.ndarray, step: int) -> np.ndarray:
    """Return by how much unit vectors (time, 3) turn in so many steps [rad]."""
    angle: np.ndarray = np.arccos(np.clip((axis[step:] * axis[:-step]).sum(axis=1), -1.0, 1.0))
    return angle


def bands(table: dict[str, np.ndarray]) -> list[dict[str, float]]:
    """Return one row for each band of range: errors rms, or median of the poses."""
    apart = {name: _length(table, name) for name in ("centroid_error", "cv_error", "cw_error")}
    speed = np.sqrt(sum(table[f"cw_velocity_error_{axis}_m_s"] ** 2 for axis in AXES))
    rows = []
    for low, high in BANDS_M:
        of = (table["true_range_m"] >= low) & (table["true_range_m"] < high)
        turn = table["icp_error_rad"][of]
        known = np.isfinite(turn)
        right = turn < RIGHT_RAD
        rows.append(
            {
                "from_m": high,
                "to_m": low,
                "frames": float(of.sum()),
                "fewest": float(table["points"][of].min()),
                "most": float(table["points"][of].max()),
                **{name: float(np.sqrt(np.nanmean(values[of] ** 2))) for name, values in apart.items()},
                "ahead": float(np.nanmean(table["centroid_error_ahead_m"][of])),
                "cw_mm_s": 1e3 * _median(speed[of]),
                "poses": float(known.mean()),
                "place": _median(table["icp_error_m"][of]),
                "axis_deg": _median(table["icp_long_axis_error_rad"][of]) / rl.units.DEG,
                "right": float(right[known].mean()) if known.any() else np.nan,
                "turn_deg": _median(turn[right]) / rl.units.DEG,
                "rate_deg_s": _median(np.abs(table["axis_rate_error_rad_s"][of])) / rl.units.DEG,
            }
        )
    return rows


def _length(table: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.sqrt(sum(table[f"{name}_{axis}_m"] ** 2 for axis in AXES))


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


def figure(tables: dict[str, dict[str, np.ndarray]]) -> Any:
    """Return the picture: points, errors of place, and of turn, over time, one column for each camera."""
    from rso_lidar.picture import figures, palette

    drawn = figures.new_figure(
        12.0,
        8.4,
        "What a tracker knows of a tumbling stage",
        "hops along the V-bar from 2 km to 50 m; grey: held for 90 s",
    )
    panels = drawn.subplots(4, len(tables), sharex=True, sharey="row", squeeze=False)
    for column, (name, table) in zip(panels.T, tables.items(), strict=True):
        time_s = table["time_s"]
        for axes in column:
            for arrival_s in ARRIVALS_S[1:]:
                axes.axvspan(arrival_s, min(arrival_s + HOLD_S, DURATION_S), color=palette.SHADE, lw=0, zorder=0)
        column[0].plot(time_s, table["true_range_m"], color=palette.QUIET, lw=figures.THICK_PT, label="range [m]")
        column[0].plot(time_s, table["points"], color=palette.ORANGE, lw=figures.LINE_PT, label="points")
        figures.style_axes(column[0], f"Camera {name}", y="range [m], points")
        for kind, word, colour in (
            ("centroid", "centroid", palette.QUIET),
            ("cv", "CV", palette.ORANGE),
            ("cw", "CW", palette.BLUE),
        ):
            column[1].plot(time_s, _length(table, f"{kind}_error"), ".", ms=1.8, color=colour, label=word)
        column[1].plot(time_s, table["icp_error_m"], ".", ms=1.8, color=palette.GREEN, label="ICP")
        figures.style_axes(column[1], y="error of place [m]")
        column[2].plot(
            time_s, table["icp_error_rad"] / rl.units.DEG, ".", ms=1.8, color=palette.RED, label="whole turn"
        )
        axis_deg = table["icp_long_axis_error_rad"] / rl.units.DEG
        column[2].plot(time_s, axis_deg, ".", ms=1.8, color=palette.BLUE, label="long axis")
        figures.style_axes(column[2], y="ICP, turn [deg]")
        column[3].plot(time_s, np.abs(table["axis_rate_error_rad_s"]) / rl.units.DEG, ".", ms=1.8, color=palette.BLUE)
        figures.style_axes(column[3], y="rate of the\nlong axis [deg/s]")
        column[3].set_xlabel("time [s]", fontsize=figures.TEXT_PT, color=palette.QUIET)
        figures.format_thousands(column[3].xaxis)
    for row in panels:
        row[0].set_yscale("log")
    for axes, mark in zip(panels[:3, -1], (1, 4, 4), strict=True):
        axes.legend(
            fontsize=figures.SMALL_PT, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4,
            markerscale=mark, borderaxespad=0.0, labelcolor=palette.QUIET,
        )  # fmt: skip
    panels[0, 0].set_ylim(8, 2.5e4)
    panels[1, 0].set_ylim(3e-3, 60)
    panels[2, 0].set_ylim(5e-3, 250)
    panels[3, 0].set_ylim(1e-4, 5)
    return drawn


def told(name: str, table: dict[str, np.ndarray], nis: dict[str, float]) -> str:
    """Return the table of a camera as text."""
    lines = [
        f"camera {name}; NIS " + ", ".join(f"{kind} {mean:.1f}" for kind, mean in nis.items()),
        "                               centroid [m]     CV     CW      CW  ICP:          the axis      the whole turn",
        "range [m]             points  error   ahead    [m]    [m]  [mm/s] poses    [m]  [deg] [deg/s]   right  [deg]",
    ]
    form = (
        "{from_m:4.0f} to {to_m:4.0f} {fewest:8.0f} to {most:5.0f}{centroid_error:7.2f}{ahead:8.2f}{cv_error:7.2f}"
        "{cw_error:7.2f}{cw_mm_s:8.1f}{poses:6.0%}{place:7.3f}{axis_deg:7.2f}{rate_deg_s:8.3f}{right:8.0%}{turn_deg:7.2f}"
    )
    lines += [form.format(**row) for row in bands(table)]
    return "\n".join(lines)


if __name__ == "__main__":
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        made = dict(zip(CAMERAS, pool.map(flown, CAMERAS.values()), strict=True))
    for name, (table, nis) in made.items():
        print(told(name, table, nis), end="\n\n")
    picture = Path(sys.argv[1] if len(sys.argv) > 1 else "tumbling.png")  # in the working folder
    save_figure(figure({name: table for name, (table, _) in made.items()}), picture)
    print(picture)
