"""`rso-lidar fit`: the follower's own orbit and its orbit relative to a target, by least squares on a recording."""

from typing import Annotated

import numpy as np
import typer

from rso_lidar import export, units
from rso_lidar.cli.arguments import RecordedFrames, RecordingFile, select_frames
from rso_lidar.cli.progress import count_frames
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.evaluation import find_true_relative_state, fit_own_orbit, fit_relative_orbit
from rso_lidar.orbit import Forces
from rso_lidar.track import MEASUREMENT_GATE, RELATIVE_MODELS

_MANY = 0.1  # share of outliers at which the forces are the likely reason; the gate alone rejects under 1 %


def fit(
    recording: RecordingFile,
    frames: RecordedFrames = None,
    target: Annotated[str | None, typer.Option("--target", metavar="NAME", help="Target (the first).")] = None,
    own_only: Annotated[bool, typer.Option("--own-only", help="Fit the follower's own orbit to GNSS only.")] = False,
    epoch_s: Annotated[
        float | None, typer.Option("--epoch", metavar="S", help="Instant of the state [s] (the first measurement).")
    ] = None,
    motion: Annotated[
        str,
        typer.Option("--motion", metavar="MODEL", help=f"Model of the relative motion: {', '.join(RELATIVE_MODELS)}."),
    ] = "nonlinear",
    zonal_degree: Annotated[
        int, typer.Option("--zonal-degree", min=0, max=6, help="Zonal harmonics of the orbits; 0 is two-body motion.")
    ] = 2,
    known_orbit: Annotated[
        bool, typer.Option("--known-orbit", help="Take the follower's recorded orbit as known, instead of GNSS.")
    ] = False,
    known_attitude: Annotated[
        bool, typer.Option("--known-attitude", help="Take its recorded attitude as known, instead of a star tracker.")
    ] = False,
    range_noise_m: Annotated[
        float | None, typer.Option("--range-noise", metavar="M", help="Noise of one range [m] (the detector's own).")
    ] = None,
    shape: Annotated[
        bool, typer.Option("--shape/--no-shape", help="Whether the fit allows for the shape of the model.")
    ] = True,
    misalignment_arcsec: Annotated[
        float, typer.Option("--misalignment", metavar="A", help="Misalignment of the boresight, 1 sigma [arcsec].")
    ] = 0.0,
    gate: Annotated[
        float, typer.Option("--gate", metavar="P", help="Probability to keep a measurement without fault.")
    ] = MEASUREMENT_GATE,
) -> None:
    """Fit own and relative orbit to a recording by least squares.

    The fit uses observations only. The truth serves for the error that is printed last.
    """
    if motion not in RELATIVE_MODELS:
        raise RecordingError(
            f"--motion {motion}: unknown model{did_you_mean(motion, RELATIVE_MODELS)} (known: {', '.join(RELATIVE_MODELS)})"
        )
    if own_only:
        unused = {
            "--target": target is not None, "--motion": motion != "nonlinear", "--known-orbit": known_orbit,
            "--range-noise": range_noise_m is not None, "--no-shape": not shape, "--misalignment": misalignment_arcsec > 0.0,
        }  # fmt: skip
        if given := [name for name, is_given in unused.items() if is_given]:
            raise RecordingError(
                f"--own-only with {given[0]}: the own orbit does not depend on it; leave one of them out"
            )
    if zonal_degree == 1:
        raise RecordingError("--zonal-degree 1: J1 does not exist; give 0 for two-body motion, or 2 to 6")
    if range_noise_m is not None and not 0.0 < range_noise_m < np.inf:
        raise RecordingError(f"--range-noise {range_noise_m:g}: needs metres above 0")
    if not 0.0 <= misalignment_arcsec < np.inf:
        raise RecordingError(f"--misalignment {misalignment_arcsec:g}: needs arcseconds from 0")
    if not 0.5 <= gate < 1.0:
        raise RecordingError(f"--gate {gate:g}: needs a probability from 0.5 to below 1")
    if epoch_s is not None and not np.isfinite(epoch_s):
        raise RecordingError(f"--epoch {epoch_s:g}: needs seconds since the start")
    forces = Forces(zonal_degree=zonal_degree) if zonal_degree else None
    with export.open(recording) as read:
        some = export.Frames(read, select_frames(read, frames))
        if own_only:
            own_fit = fit_own_orbit(
                some,
                epoch_s=epoch_s,
                forces=forces,
                known_attitude=known_attitude,
                gate=gate,
                folder=recording.parent,
            )
            lines, fits = own_fit.describe().splitlines(), [own_fit.statistics]
        else:
            navigation = fit_relative_orbit(
                some,
                target,
                epoch_s=epoch_s,
                motion=motion,
                forces=forces,
                known_orbit=known_orbit,
                known_attitude=known_attitude,
                range_noise_m=range_noise_m,
                shape=shape,
                misalignment_rad=misalignment_arcsec * units.ARCSEC,
                gate=gate,
                folder=recording.parent,
                each=count_frames(some, "fitting"),
            )
            fits = [estimate.statistics for estimate in (navigation.own, navigation.fit) if estimate is not None]
            truth = find_true_relative_state(some, navigation.target, navigation.fit.epoch_s)
            lines = navigation.describe().splitlines() + (
                [] if truth is None else navigation.fit.describe_error(*truth)
            )
    for line in lines:
        echo(line)
    for used in fits:
        if zonal_degree and used.n_rejected > _MANY * len(used.used):
            echo(
                f"note: {used.n_rejected:,} of {len(used.used):,} measurements do not fit these forces; where the recorded "
                "motion is two-body (kepler, state and hill motions are), give --zonal-degree 0"
            )
