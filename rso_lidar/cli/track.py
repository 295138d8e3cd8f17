"""`rso-lidar track`: reference trackers on a recording, and their errors against the truth."""

import contextlib
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar import export, units
from rso_lidar.cli.arguments import Dark, Overwrite, RecordedFrames, RecordingFile, choose_scheme, select_frames
from rso_lidar.cli.progress import count_frames
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.evaluation import Tracking, measure_centroid_wander, tracking
from rso_lidar.files import check_writable
from rso_lidar.picture import RESULT_SUFFIXES
from rso_lidar.rpo import CentroidWander, SensorBias
from rso_lidar.track import FEWEST_POSE_POINTS, nis_bounds


def track(
    recording: RecordingFile,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Picture (.png, .pdf, .svg) or table (.csv); none, the table alone."),
    ] = None,
    frames: RecordedFrames = None,
    target: Annotated[str | None, typer.Option("--target", metavar="NAME", help="Target (the first).")] = None,
    range_noise_m: Annotated[
        float | None, typer.Option("--range-noise", metavar="M", help="Noise of one range [m] (the detector's own).")
    ] = None,
    acceleration: Annotated[
        float, typer.Option("--acceleration", metavar="Q", help="Process noise of the filters [m/s2/sqrt(Hz)].")
    ] = 1e-4,
    shape: Annotated[
        bool, typer.Option("--shape/--no-shape", help="Whether the filters allow for the shape of the model.")
    ] = True,
    wander: Annotated[
        str | None,
        typer.Option(
            "--wander",
            metavar="M,M,S",
            help="Wander of the centroid that the filters estimate: metres along and across, correlation time [s].",
        ),
    ] = None,
    range_bias_m: Annotated[
        float | None,
        typer.Option("--range-bias", metavar="M", help="Sigma of a constant range bias that the filters estimate [m]."),
    ] = None,
    icp: Annotated[bool, typer.Option("--icp/--no-icp", help="Whether ICP runs, 0.2 to 2 s a frame.")] = True,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Track the target of a recording and compare with the truth. Trackers: centroid, Kalman filters and ICP."""
    if output is not None:
        output = check_writable(output, RESULT_SUFFIXES, overwrite=overwrite)
    scheme = choose_scheme(dark, [output])
    if range_noise_m is not None and not 0.0 < range_noise_m < np.inf:
        raise RecordingError(f"--range-noise {range_noise_m:g}: needs metres above 0")
    if not 0.0 <= acceleration < np.inf:
        raise RecordingError(f"--acceleration {acceleration:g}: needs a number from 0")
    if range_bias_m is not None and not 0.0 < range_bias_m < np.inf:
        raise RecordingError(f"--range-bias {range_bias_m:g}: needs metres above 0")
    centroid = None if wander is None else _read_wander(wander)
    with export.open(recording) as read:
        some = export.Frames(read, select_frames(read, frames))
        quality = tracking(
            some,
            target,
            folder=recording.parent,
            range_noise_m=range_noise_m,
            acceleration_m_s2_sqrt_hz=acceleration,
            shape=shape,
            poses=icp,
            bias=None if range_bias_m is None else SensorBias(range_sigma_m=range_bias_m),
            centroid=centroid,
            each=count_frames(some, "tracking"),
        )
    for line in summarise(quality, icp=icp):
        echo(line)
    if output is not None:
        quality.save(output, scheme)
        echo(f"{output}")


def _read_wander(text: str) -> CentroidWander:
    """Read `--wander`: metres along and across the line of sight, and seconds."""
    try:
        along_m, across_m, seconds = (float(word) for word in text.split(","))
    except ValueError as error:
        raise RecordingError(
            f"--wander {text}: needs three numbers, metres along and across the line of sight, and seconds; give them as "
            "0.6,0.1,95"
        ) from error
    try:
        return CentroidWander(along_sigma_m=along_m, across_sigma_m=across_m, correlation_time_s=seconds)
    except ScenarioError as error:
        raise RecordingError(f"--wander {text}: {str(error).removeprefix('CentroidWander: ')}") from error


def summarise(quality: Tracking, *, icp: bool = True) -> list[str]:
    """Format the table of errors: rms, bias and spread along right, down and ahead; NIS; ICP if it ran."""
    table = quality.table
    seen, most = int(np.sum(table["points"] > 0)), int(table["points"].max())
    lines = [
        f"{quality.target}: {seen:,} of {table['time_s'].size:,} frames with a fix; "
        f"range noise {quality.range_noise_m:.3g} m, process noise {quality.acceleration_m_s2_sqrt_hz:g} m/s2/sqrt(Hz)",
        f"{'':<20}{'rms error [m], of that bias / spread':>60}",
        f"{'':<20}" + "".join(f"{axis:>27}" for axis in quality.AXES),
    ]
    for name, word in {
        "centroid": "centroid",
        **{kind: quality.FILTERS[kind] for kind in quality.tracks},
    }.items():
        lines.append(
            f"{word:<20}" + "".join(f"{_format_rms(table[f'{name}_error_{axis}_m']):>27}" for axis in quality.AXES)
        )
    for kind, track in quality.tracks.items():
        count = int(np.isfinite(track.nis).sum())
        if not count:
            lines.append(f"{quality.FILTERS[kind]:<20}no NIS: it takes two fixes")
            continue
        speed = np.linalg.norm([table[f"{kind}_velocity_error_{axis}_m_s"] for axis in quality.AXES], axis=0)
        low, high = nis_bounds(count)
        lines.append(
            f"{quality.FILTERS[kind]:<20}NIS mean {track.nis_mean:.2f} (95 % bounds {low:.2f} to {high:.2f}), "
            f"{track.nis_share:.0%} inside its bounds; velocity, median error {np.nanmedian(speed):.3g} m/s"
        )
        verdict = describe_consistency(track.nis_mean, count)
        if verdict:
            lines.append(f"{'':<20}{verdict}")
        lines += [
            f"{'':<20}{name.replace('_', ' ')}: {values[-1]:+.3g} ± {track.slow_sigma[name][-1]:.2g} at the end"
            for name, values in track.slow.items()
        ]
    with contextlib.suppress(RecordingError):  # of few frames, or of a target that stands still
        lines.append(f"{'centroid':<20}{measure_centroid_wander(quality).describe()}")
    if "icp_error_rad" in table:
        turn, axis, place = (table[name] for name in ("icp_error_rad", "icp_long_axis_error_rad", "icp_error_m"))
        known = np.isfinite(turn)
        lines.append(
            f"{'icp':<20}{known.sum():,} poses; turn {_format_ranks(turn / units.DEG, '.2f')} deg, of the long axis "
            f"{_format_ranks(axis / units.DEG, '.2f')} deg, place {_format_ranks(place, '.3f')} m (median, 90 %)"
        )
        lines += [_describe_hinge(name, table) for name in quality.hinges]
    elif icp:
        lines.append(
            f"{'icp':<20}no pose: it takes {FEWEST_POSE_POINTS} points of a frame, and no frame had over {most:,}"
        )
    return lines


def _describe_hinge(name: str, table: dict[str, np.ndarray]) -> str:
    """Describe the errors of a hinge's angle, and how often the angle is that of the other side of a flat array."""
    error_rad = table[f"icp_hinge_{name}_error_rad"]
    beside_rad = np.arctan(np.tan(error_rad))  # from the nearer of two angles that are half a turn apart
    opposite = np.mean(np.abs(error_rad[np.isfinite(error_rad)]) > 0.5 * np.pi)
    return (
        f"{'':<20}hinge {name}: angle {_format_ranks(np.abs(beside_rad) / units.DEG, '.2f')} deg, "
        f"in {opposite:.0%} of the poses half a turn away"
    )


def describe_consistency(nis_mean: float, count: int) -> str:
    """Explain a mean NIS outside its 95 % bounds and the option to change; empty if it is inside.

    Notes
    -----
    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), sec. 5.4: a mean below
    the bounds shows covariances that are too large, one above them covariances that are too small, or a bias.
    """
    low, high = nis_bounds(count)
    if nis_mean < low:
        return (
            "below its bounds: under-confident, the filter assumes more noise than its innovations show; lower "
            "--range-noise or --acceleration, or try --no-shape where the target hardly turns"
        )
    if nis_mean > high:
        return (
            "above its bounds: over-confident, the filter assumes too little noise or a motion that does not fit; raise "
            "--acceleration (motion) or --range-noise (fixes)"
        )
    return ""


def _format_rms(error_m: np.ndarray) -> str:
    known = error_m[np.isfinite(error_m)]
    if not known.size:
        return "none"
    return f"{np.sqrt(np.mean(known**2)):.3f}, {known.mean():+.3f} / {known.std():.3f}"


def _format_ranks(values: np.ndarray, form: str) -> str:
    middle, high = np.nanpercentile(values, [50, 90])
    return f"{middle:{form}}, {high:{form}}"
