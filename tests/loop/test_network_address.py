"""Addresses of servers, and which of them other machines can reach."""

import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.loop import parse_address
from rso_lidar.loop.network_address import require_loopback


def test_hosts_and_ports():
    assert parse_address("[::1]:80", "--live-at") == ("::1", 80)
    assert parse_address("[::1]:80", "--live-at").text == "[::1]:80"
    assert parse_address("127.0.0.7:0", "x").is_loopback and parse_address("localhost:1", "x").is_loopback
    assert not parse_address("10.0.0.1:1", "x").is_loopback


@pytest.mark.parametrize(
    "text", ["8765", "host", "1.2.3.4", "a.b:80", "127.0.0.1:99999", "127.0.0.1:-1", "::1:80", "", ":80"]
)
def test_others_are_refused(text):
    with pytest.raises(ScenarioError, match=r"^--live-at .*write for example 127\.0\.0\.1:8765$"):
        parse_address(text, "--live-at")


def test_an_open_address_is_refused_with_a_way_out():
    with pytest.raises(ScenarioError, match=r"ssh -L 90:127\.0\.0\.1:90"):
        require_loopback(parse_address("10.0.0.1:90", "x"), "x", "the view")
