"""Errors: one family, each also the builtin that a caller would catch."""

import inspect
import pickle
import warnings

import numpy as np
import pytest

from rso_lidar import errors

RAISED = [cls for _, cls in inspect.getmembers(errors, inspect.isclass) if issubclass(cls, errors.RsoLidarError)]


@pytest.mark.parametrize("cls", RAISED, ids=lambda cls: cls.__name__)
def test_error_is_of_the_family_and_says_when_it_is_raised(cls):
    assert issubclass(cls, errors.RsoLidarError)
    assert cls.__doc__


@pytest.mark.parametrize("cls", [cls for cls in RAISED if cls.__bases__ != (Exception,)], ids=lambda cls: cls.__name__)
def test_error_is_bad_input_or_a_failed_run_and_never_both(cls):
    """The command line exits with 2 for the one and 1 for the other."""
    assert issubclass(cls, ValueError) != issubclass(cls, RuntimeError)
    assert issubclass(cls, RuntimeError) == (cls is errors.RunError)


@pytest.mark.parametrize("cls", RAISED, ids=lambda cls: cls.__name__)
def test_message_is_kept_and_crosses_processes(cls):
    error = pickle.loads(pickle.dumps(cls("a.toml: seed: is missing; give a value")))
    assert type(error) is cls
    assert str(error) == "a.toml: seed: is missing; give a value"


def test_propagation_error_carries_the_bad_epochs():
    error = errors.PropagationError("two epochs have no answer", bad=[True, False, True])
    np.testing.assert_array_equal(error.bad, [True, False, True])
    assert error.bad.dtype == bool
    assert errors.PropagationError("none named").bad.size == 0


def test_warning_is_a_users():
    with pytest.warns(UserWarning, match="assumed"):
        warnings.warn("center_of_mass_m: assumed", errors.RsoLidarWarning, stacklevel=1)


@pytest.mark.parametrize(
    ("word", "guess"),
    [
        ("fov_degs", "; did you mean 'fov_deg'?"),
        ("natural_freq_hz", "; did you mean 'natural_hz'?"),
        ("zzz", ""),
        ("", ""),
    ],
)
def test_did_you_mean(word, guess):
    assert errors.did_you_mean(word, ["fov_deg", "natural_hz", "damping"]) == guess


def test_did_you_mean_without_anything_known():
    assert errors.did_you_mean("fov_deg", []) == ""


def test_did_you_mean_takes_what_can_be_read_once():
    assert "fov_deg" in errors.did_you_mean("fov_dge", (word for word in ["fov_deg"]))


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        (".cvs", ".csv"),
        (".csvv", ".csv"),
        (".cs", ".csv"),
        (".h6", ".h5"),
        (".hdf", ".hdf5"),
        (".h", ".h5"),
        (".pnng", ".png"),
    ],
)
def test_a_suffix_with_one_slip_is_known(written, meant):
    assert errors.did_you_mean(written, [".png", ".csv", ".h5", ".hdf5", ".oem"]) == f"; did you mean '{meant}'?"


@pytest.mark.parametrize("written", [".foo", ".txt", ".xyz", ".jpg", ".mat", ".o", ".", "", ".h5x9", ".zip", ".pdfs"])
def test_a_suffix_that_only_shares_letters_is_no_guess(written):
    known = [".png", ".csv", ".h5", ".hdf5", ".oem", ".aem", ".czml", ".npz", ".zarr", ".tum", ".ply", ".pcd", ".bop"]
    assert errors.did_you_mean(written, known) == ""


def test_problems_are_joined_as_far_as_they_fit():
    assert errors.join_problems(["a", "b"]) == "a; b"
    assert errors.join_problems(["a", "b"], ", ") == "a, b"
    assert errors.join_problems(["x" * 398, "y" * 400, "z"]) == "x" * 398 + "; " + "y" * 400 + " (and 1 more)"
    assert errors.join_problems(["x" * 900, "y"]) == "x" * 900 + " (and 1 more)"


def test_warnings_are_collected_once_each_and_not_shown():
    with errors.suppress_warnings(), errors.collect_warnings() as lines:
        for message in ("a: is odd", "b: is odder", "a: is odd"):
            errors.warn(message)
        errors.warn_of_input("c.oem: has a gap")
        with errors.suppress_warnings():
            errors.warn("d: is suppressed here")
    assert lines == ["a: is odd", "b: is odder", "c.oem: has a gap"]


def test_what_is_warned_of_once_a_process_is_collected_each_time():
    with pytest.warns(errors.RsoLidarWarning, match="e: is odd"):
        errors.warn("e: is odd", about="e")
    errors.warn("e: is odd", about="e")  # an error here, if it were shown again
    for _ in range(2):
        with errors.collect_warnings() as lines:
            errors.warn("e: is odd", about="e")
        assert lines == ["e: is odd"]
