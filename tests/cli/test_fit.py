"""`rso-lidar fit`: what it prints of a recording, and what it refuses."""

from functools import partial

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.study.dispersions.start_errors import resolve_start_errors
from tests.evaluation.orbit_determination.scenario_for_tests import load_small


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    """Return the file of six frames of a stage, with star tracker and GNSS."""
    path = tmp_path_factory.mktemp("fit") / "stage.h5"
    rl.save(path, rl.simulate(load_small("time.duration_s=12")))
    return path


@pytest.fixture
def call(rso_lidar):
    return partial(rso_lidar, "fit")


def test_both_orbits_and_the_error_are_printed(call, stage):
    status, said, _ = call(stage, "--zonal-degree", "0", "--range-noise", "0.05")
    assert status == 0
    lines = said.splitlines()
    # After the last sample of the star tracker there is no attitude.
    assert lines[0] == "Inertial unit, star tracker and GNSS beside the lidar: 5 of 6 frames measure stage"
    assert lines[1].startswith("relative orbit: 5 of 5 measurements, 0 outliers; motion nonlinear")
    assert any(line.startswith("own orbit: ") for line in lines)
    assert lines[-1].startswith("NEES ") and lines[-3].startswith("error [m]")


def test_the_own_orbit_alone_and_an_epoch_between_frames(call, stage):
    status, said, _ = call(stage, "--own-only", "--epoch", "4.5")
    assert status == 0 and said.startswith("own orbit: ") and "state at 4.5 s in GCRS axes" in said
    said = call(stage, "--epoch", "4.5", "--motion", "hill", "--no-shape", "--known-orbit", "--range-noise", "0.05")[1]
    assert "NEES" not in said and "motion hill" in said and said.splitlines()[-1] == "own orbit: taken as known"


def test_orbit_and_measurements_of_a_recording_are_fitted_again(call, rso_lidar, stage, tmp_path):
    own, track = tmp_path / "own.opm", tmp_path / "track.tdm"
    status, said, _ = call(stage, "--zonal-degree", "0", "--own-only", "-o", own)
    assert status == 0 and said.splitlines()[-1] == str(own)
    assert "CZ_DOT_Z_DOT = " in own.read_text()
    assert rso_lidar("export", stage, "--to", track)[0] == 0
    status, said, _ = call(track, "--own", own, "--zonal-degree", "0")
    lines = said.splitlines()
    assert status == 0 and lines[0] == "track.tdm: follower measures stage from 2024-09-17T12:00:00.000Z on"
    assert lines[1].startswith("relative orbit: 5 of 5 measurements, 0 outliers; motion nonlinear")
    for options, message in (
        ((), "track.tdm: a message has no orbit of its observer; name its file with --own"),
        (
            ("--own", own, "--known-orbit"),
            "--known-orbit: is for a recording, not a tracking data message; leave it out",
        ),
        (("--own", own, "--target", "x"), "no target 'x' (targets: stage)"),
        (("--own", track), "begins with 'CCSDS_TDM_VERS = 2.0'; an OEM begins with CCSDS_OEM_VERS = ..."),
        (("--own", own, "--angle-noise", "0"), "--angle-noise 0: needs arcseconds above 0"),
    ):
        status, _, errors = call(track, *options)
        assert status == 2 and errors[-1].endswith(message)


def test_orbits_of_a_fit_are_written_with_covariances_that_others_read(call, rso_lidar, stage, tmp_path):
    own, target, single = (tmp_path / name for name in ("own.oem", "stage.oem", "stage.opm"))
    options = (stage, "--zonal-degree", "0", "--range-noise", "0.05")
    status, said, _ = call(*options, "-o", own, "--target-orbit", target)
    assert status == 0 and said.splitlines()[-2:] == [str(own), str(target)]
    assert "note: errors of the follower's orbit are errors of the target's, too" in said
    assert call(*options, "--target-orbit", single)[0] == 0
    follower, approached, at_epoch = (rl.orbit.read_covariances(file) for file in (own, target, single))
    assert (follower.label, approached.label) == ("follower", "stage")
    assert len(follower.epochs) == 4  # so that interpolation is of degree 7
    start = rl.orbit.Epochs(follower.epochs.start_utc, follower.epochs.time_s[:1])
    apart = approached.reference.states(start).position_m - follower.reference.states(start).position_m
    assert np.linalg.norm(apart) == pytest.approx(60.5, abs=2.0)  # scenario: 60 m along the track, 4 m across it
    there = rl.orbit.Epochs(at_epoch.epochs.start_utc, at_epoch.epochs.time_s)
    np.testing.assert_allclose(
        at_epoch.sigma, np.sqrt(np.diagonal(approached.at(there, axes="rtn"), 0, 1, 2)), rtol=1e-3
    )
    # both orbits share the errors of GNSS, about 1 m; the relative state is better known than either
    assert 0.1 < follower.sigma[0, 0] < 3.0 and 0.1 < approached.sigma[0, 0] < 3.0
    scenario = load_small(
        "dispersion.start.type='covariance'", f"dispersion.start.file={str(own)!r}",
        "dispersion.target.start.type='covariance'", f"dispersion.target.start.file={str(target)!r}",
    )  # fmt: skip
    found = resolve_start_errors(scenario, "stage")
    rtn = follower.at(scenario.time.start_utc, axes="rtn", rotating=True)[0]
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), np.sqrt(np.diag(rtn)), rtol=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--own-only", "--target-orbit", "never.oem"),
            "--own-only with --target-orbit: the own orbit does not depend on it; leave one of them out",
        ),
        (
            ("-o", "a.oem", "--target-orbit", "a.oem"),
            "--target-orbit a.oem: is the file of --output, too; give another name",
        ),
        (("--own", "x.opm"), "--own: is for a tracking data message (.tdm); leave it out"),
        (("--round-trip",), "--round-trip: is for a tracking data message (.tdm); leave it out"),
        (
            ("--known-orbit", "-o", "never.opm"),
            "--output with --known-orbit: a known orbit is not fitted; leave one of them out",
        ),
        (("--target", "stag"), "fit: no target named 'stag'; did you mean 'stage'? (known: stage)"),
        (
            ("--motion", "hil"),
            "--motion hil: unknown model; did you mean 'hill'? (known: nonlinear, yamanaka_ankersen, hill)",
        ),
        (
            ("--own-only", "--target", "stage"),
            "--own-only with --target: the own orbit does not depend on it; leave one of them out",
        ),
        (("--zonal-degree", "1"), "--zonal-degree 1: J1 does not exist; give 0 for two-body motion, or 2 to 6"),
        (("--range-noise", "0"), "--range-noise 0: needs metres above 0"),
        (("--misalignment", "-1"), "--misalignment -1: needs arcseconds from 0"),
        (("--gate", "1"), "--gate 1: needs a probability from 0.5 to below 1"),
        (("--epoch", "nan"), "--epoch nan: needs seconds since the start"),
        (
            ("--frames", "0:2", "--known-orbit"),
            "relative orbit: needs 3 or more measurements, not 1; give more frames",
        ),
        (("--frames", "0:2"), "own orbit: needs 3 or more valid solutions of GNSS, not 2; record more"),
        (
            ("--epoch", "1e9"),
            "own orbit: epoch 1e+09 s is more than a day from the measurements; give an instant near them",
        ),
        (("--frames", "90:99"), "--frames 90:99: stage.h5 holds none of them, but 6 from 0 to 5"),
    ],
)
def test_wrong_options_are_one_line_and_status_2(call, stage, options, message):
    status, _, errors = call(stage, *options)
    assert status == 2
    assert errors[-1].endswith(message)


def test_a_recording_without_sensors_needs_flags(call, recorded):
    status, _, errors = call(recorded)
    assert status == 2 and "fit: " in errors[-1]


def test_ranges_without_noise_are_refused(call, tmp_path):
    """So much light that all pixels of the target return: its centroid is known as well as one range.

    Rounding decides whether the covariance is singular to the computer, or the measurements contradict each other by more
    than a nanometre.
    """
    path = tmp_path / "bright.h5"
    rl.save(path, rl.simulate(load_small("time.duration_s=12", "lidar.laser.energy_mj=5000")))
    status, _, errors = call(path, "--range-noise", "1e-9", "--no-shape")
    assert status == 2
    assert errors[-1].startswith("error: relative orbit: ") and "; state more noise" in errors[-1]
