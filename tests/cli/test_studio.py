"""`rso-lidar studio`: its arguments. What it serves is tested in tests/studio."""

import pytest


def test_a_missing_folder_is_one_line(rso_lidar, tmp_path):
    status, printed, errors = rso_lidar("studio", tmp_path / "none", "--no-browser")
    assert (status, printed, len(errors)) == (2, "", 1)
    assert "is not a folder; make it first, or name another" in errors[0]


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("8080", "is not HOST:PORT"),
        ("example.org:80", "the host is no numeric address"),
        ("127.0.0.1:99999", "no port is above 65535"),
    ],
)
def test_other_addresses_are_one_line(rso_lidar, tmp_path, address, said):
    status, printed, errors = rso_lidar("studio", tmp_path, "--no-browser", "--at", address)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert errors[0].startswith(f"--at {address}") or f"--at {address}: {said}" in errors[0]


def test_help_says_what_leaves_the_machine(rso_lidar):
    status, printed, _ = rso_lidar("studio", "--help")
    assert status == 0
    assert "works without a network" in " ".join(printed.split())
    assert "127.0.0.1:0" in printed
