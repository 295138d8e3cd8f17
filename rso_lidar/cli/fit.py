"""`rso-lidar fit`: the follower's own orbit and its orbit relative to a target, by least squares on measurements."""

import datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar import export, units
from rso_lidar.cli.arguments import Overwrite, RecordedFrames, select_frames
from rso_lidar.cli.progress import count_frames
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.evaluation import find_true_relative_state, fit_own_orbit, fit_relative_orbit, fit_tracking_data
from rso_lidar.files import check_writable
from rso_lidar.orbit import Epochs, Forces, State, TrackingDataMessage, format_utc, write_oem, write_opm
from rso_lidar.track import MEASUREMENT_GATE, RELATIVE_MODELS, EstimatedOrbit

_ORBITS = (".opm", ".oem")
_STEP_S = 60.0  # between rows: interpolation of degree 7 is good to 1 um in low orbit
_FEWEST_ROWS = 4  # that degree 7 needs; the cubic through two rows is off by 0.3 m in low orbit
_MANY = 0.1  # share of outliers at which the forces are the likely reason; the gate alone rejects under 1 %


def fit(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE", help="Recording (.h5, .nc, or .zarr), or tracking data message (.tdm).")
    ],
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
        float | None,
        typer.Option("--range-noise", metavar="M", help="Noise of one range [m] (the detector's own; the message's)."),
    ] = None,
    angle_noise_arcsec: Annotated[
        float | None,
        typer.Option("--angle-noise", metavar="A", help="tdm: noise of one angle [arcsec] (the message's)."),
    ] = None,
    own: Annotated[
        Path | None, typer.Option("--own", metavar="FILE", help="tdm: the observer's orbit, an OPM, OEM or CSV file.")
    ] = None,
    round_trip: Annotated[
        bool, typer.Option("--round-trip", help="tdm: two-way ranges are the length of both ways, not half of it.")
    ] = False,
    shape: Annotated[
        bool, typer.Option("--shape/--no-shape", help="Whether the fit allows for the shape of the model.")
    ] = True,
    misalignment_arcsec: Annotated[
        float, typer.Option("--misalignment", metavar="A", help="Misalignment of the boresight, 1 sigma [arcsec].")
    ] = 0.0,
    gate: Annotated[
        float, typer.Option("--gate", metavar="P", help="Probability to keep a measurement without fault.")
    ] = MEASUREMENT_GATE,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the own orbit with its covariance (.opm, .oem).")
    ] = None,
    target_orbit: Annotated[
        Path | None,
        typer.Option(
            "--target-orbit", metavar="FILE", help="Write the target's orbit with its covariance (.opm, .oem)."
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Fit own and relative orbit to a recording by least squares.

    A tracking data message (.tdm) gives the relative orbit alone. The fit uses observations only. The truth serves for the
    error that is printed last.
    """
    if motion not in RELATIVE_MODELS:
        raise RecordingError(
            f"--motion {motion}: unknown model{did_you_mean(motion, RELATIVE_MODELS)} (known: {', '.join(RELATIVE_MODELS)})"
        )
    is_message = recording.suffix.lower() == ".tdm"
    others = {
        "--own": own is not None, "--angle-noise": angle_noise_arcsec is not None, "--round-trip": round_trip
    } if not is_message else {
        "--frames": frames is not None, "--own-only": own_only, "--known-orbit": known_orbit,
        "--known-attitude": known_attitude, "--no-shape": not shape, "--misalignment": misalignment_arcsec > 0.0,
        "--output": output is not None,
    }  # fmt: skip
    if given := [name for name, is_given in others.items() if is_given]:
        kind = "recording, not a tracking data message" if is_message else "tracking data message (.tdm)"
        raise RecordingError(f"{given[0]}: is for a {kind}; leave it out")
    if target_orbit is not None:
        target_orbit = check_writable(target_orbit, _ORBITS, overwrite=overwrite)
    if output is not None:
        output = check_writable(output, _ORBITS, overwrite=overwrite)
        if target_orbit is not None and target_orbit.resolve() == output.resolve():
            raise RecordingError(f"--target-orbit {target_orbit}: is the file of --output, too; give another name")
        if known_orbit:
            raise RecordingError("--output with --known-orbit: a known orbit is not fitted; leave one of them out")
    if own_only:
        unused = {
            "--target": target is not None, "--motion": motion != "nonlinear", "--known-orbit": known_orbit,
            "--target-orbit": target_orbit is not None,
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
    if angle_noise_arcsec is not None and not 0.0 < angle_noise_arcsec < np.inf:
        raise RecordingError(f"--angle-noise {angle_noise_arcsec:g}: needs arcseconds above 0")
    if epoch_s is not None and not np.isfinite(epoch_s):
        raise RecordingError(f"--epoch {epoch_s:g}: needs seconds since the start")
    forces = Forces(zonal_degree=zonal_degree) if zonal_degree else None
    if is_message:
        if own is None:
            raise RecordingError(f"{recording}: a message has no orbit of its observer; name its file with --own")
        sigma_rad = None if angle_noise_arcsec is None else angle_noise_arcsec * units.ARCSEC
        message = TrackingDataMessage.from_file(recording)
        fitted = fit_tracking_data(
            message, own, target, range_sigma_m=range_noise_m, angle_sigma_rad=sigma_rad, round_trip=round_trip,
            epoch_s=epoch_s, motion=motion, forces=forces, gate=gate,
        )  # fmt: skip
        (chosen, *_) = message.select_target(target)
        echo(
            f"{recording.name}: {chosen.observer} measures {chosen.target} from {format_utc(message.start_utc, 0.0)} on"
        )
        for line in fitted.describe(chosen.target).splitlines():
            echo(line)
        if target_orbit is not None:
            _write_orbit(target_orbit, fitted.find_target_orbit(), chosen.target, fitted.statistics.time_s)
            echo(f"{target_orbit}")
        return
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
            lines, fits, orbit, relative = own_fit.describe().splitlines(), [own_fit.statistics], own_fit.orbit, None
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
            orbit, relative = navigation.fit.own, navigation
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
    if target_orbit is not None:
        echo(
            "note: errors of the follower's orbit are errors of the target's, too; commands that take both as independent, "
            "such as encounters, overstate the errors of the relative state"
        )
    time_s = np.concatenate([used.time_s for used in fits])
    if output is not None:
        _write_orbit(output, orbit, "follower", time_s)
        echo(f"{output}")
    if target_orbit is not None and relative is not None:
        _write_orbit(target_orbit, relative.fit.find_target_orbit(), relative.target, time_s)
        echo(f"{target_orbit}")


def _write_orbit(output: Path, orbit: EstimatedOrbit, name: str, time_s: np.ndarray) -> None:
    """Write an estimated orbit with its covariance as an OEM over measurements and start of the run, or as an OPM.

    The epoch of an OPM is the whole microsecond of UTC next to that of the orbit.

    Parameters
    ----------
    time_s : (measurement) instants since the start of the run [s]
    """
    if output.suffix.lower() == ".oem":
        first_s, last_s = min(0.0, orbit.epoch_s, time_s.min()), max(orbit.epoch_s, time_s.max())
        n_rows = max(_FEWEST_ROWS, 1 + int(np.ceil((last_s - first_s) / _STEP_S)))
        epochs = Epochs(orbit.start_utc, np.linspace(first_s, last_s, n_rows))
        known = orbit.covariances(epochs, name)
        write_oem(output, name, name, epochs, orbit.states(epochs), covariances=known, overwrite=True)
        return
    epoch_utc, elapsed_s = orbit.start_utc, 0.0
    for _ in range(2):  # a leap second in between counts as a second
        epoch_utc += datetime.timedelta(seconds=orbit.epoch_s - elapsed_s)
        elapsed_s = float(Epochs(epoch_utc, np.zeros(1)).since(orbit.start_utc)[0])
    moved = orbit.move_epoch(elapsed_s)
    state = State(
        epoch_utc=epoch_utc,
        position_m=tuple(moved.position_m.tolist()),
        velocity_m_s=tuple(moved.velocity_m_s.tolist()),
    )
    write_opm(output, name, name, state, covariance=moved.covariance, overwrite=True)
