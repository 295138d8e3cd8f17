"""`rso-lidar run --live`: where it listens, what it says, and what it refuses."""

import pytest

pytest.importorskip("foxglove", reason="the extra live is not installed")


@pytest.fixture
def call(rso_lidar):
    return lambda *arguments: rso_lidar("run", *arguments)


def test_a_run_is_shown_and_recorded(call, bench, tmp_path):
    settings = ("--set", "lidar.detector.type=empirical", "--frames", "0:3")
    status, said, errors = call(bench, "-o", tmp_path / "x.h5", "--live-at", "127.0.0.1:0", *settings)
    assert status == 0 and said.splitlines()[-1].startswith("live view   3 frames shown, 0 dropped")
    assert errors[0].startswith("live view   ws://127.0.0.1:") and (tmp_path / "x.h5").is_file()


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("0.0.0.0:8765", "opens only on this machine"),
        ("8765", "is not HOST:PORT"),
        ("example.com:80", "no numeric address"),
    ],
)
def test_other_addresses_are_refused(refused, address, said):
    refused(("-o", "x.h5", "--live-at", address), said)


def test_other_viewers_are_refused(refused):
    refused(("-o", "x.h5", "--live-with", "paraview"), "no such viewer (known: foxglove, rerun)")


def test_a_web_page_is_given_by_its_origin(refused):
    refused(
        ("-o", "x.h5", "--live-origin", "localhost"), "--live-origin localhost: is not an origin; write for example"
    )
    refused(("-o", "x.h5", "--live-with", "rerun", "--live-origin", "http://a.example"), "does not apply to rerun")
