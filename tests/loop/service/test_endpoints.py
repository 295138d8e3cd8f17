"""Who may connect from where: loopback, a token, CURVE keys."""

import pytest

import rso_lidar as rl
from rso_lidar.loop import read_token
from rso_lidar.loop.service.endpoints import is_private
from tests.loop.service.serving import serving

zmq = pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")

TOKEN = "0123456789abcdef"


@pytest.mark.parametrize(
    ("endpoint", "private"),
    [
        ("tcp://127.0.0.1:5571", True),
        ("tcp://127.8.9.1:*", True),
        ("tcp://localhost:1", True),
        ("tcp://[::1]:5571", True),
        ("ipc://lidar", True),
        ("tcp://0.0.0.0:5571", False),
        ("tcp://*:5571", False),
        ("tcp://[::]:5571", False),
        ("tcp://192.0.2.7:5571", False),
        ("tcp://eth0:5571", False),
        ("tcp://127.0.0.1.example.org:5571", False),
    ],
)
def test_only_loopback_is_private(endpoint, private):
    assert is_private("--bind", endpoint) == private
    security = rl.loop.Security()
    if private:
        security.check("--bind", endpoint)
        return
    with pytest.raises(rl.ScenarioError, match="can be reached from other machines; give --curve-key"):
        security.check("--bind", endpoint)
    rl.loop.Security(token=TOKEN).check("--bind", endpoint)
    with pytest.raises(rl.ScenarioError, match="a stream asks for no token"):
        rl.loop.Security(token=TOKEN).check("--publish", endpoint, is_stream=True)


@pytest.mark.parametrize(
    "endpoint", ["", "127.0.0.1:5571", "udp://127.0.0.1:1", "tcp://127.0.0.1", "tcp://127.0.0.1:99999"]
)
def test_what_is_no_address(endpoint):
    with pytest.raises(rl.ScenarioError, match="is not an address"):
        is_private("--bind", endpoint)


def test_a_token_is_asked_for(scenario, tmp_path):
    file = tmp_path / "token"
    file.write_text(f"{TOKEN}\n")
    security = rl.loop.Security(token=read_token(file))
    with serving(scenario, security=security) as server:
        for wrong in (None, TOKEN[:-1], TOKEN + "x", "é" * 16):
            with pytest.raises(rl.ScenarioError, match="has no token, or a wrong one"):
                rl.loop.Client(server.endpoint, token=wrong, timeout_s=30)
        with rl.loop.Client(server.endpoint, token=TOKEN, timeout_s=30) as client:
            assert client.step().index == 0
    file.write_text(" \n")
    with pytest.raises(rl.ScenarioError, match="holds no token"):
        read_token(file)
    with pytest.raises(rl.ScenarioError, match="give at least 16"):
        rl.loop.Security(token="short")


def test_curve_keys_let_in_whom_the_server_knows(scenario, tmp_path):
    if not zmq.has("curve"):
        pytest.skip("this libzmq is built without CURVE")
    from zmq.auth import create_certificates

    known = tmp_path / "known"
    known.mkdir()
    create_certificates(tmp_path, "server")
    create_certificates(known, "friend")
    create_certificates(tmp_path, "stranger")
    security = rl.loop.Security(server_key=tmp_path / "server.key_secret", client_keys=known)
    keys = {"server_key": tmp_path / "server.key", "timeout_s": 30}
    with serving(scenario, security=security) as server:
        with rl.loop.Client(server.endpoint, key=known / "friend.key_secret", **keys) as client:
            assert client.step().index == 0
        with pytest.raises(rl.ScenarioError, match="refused the connection; check the CURVE keys"):
            rl.loop.Client(server.endpoint, key=tmp_path / "stranger.key_secret", **keys)
        with pytest.raises(rl.RsoLidarError, match=r"refused the connection|no server answers"):
            rl.loop.Client(server.endpoint, timeout_s=1.0)
    with pytest.raises(rl.ScenarioError, match="holds no secret key"):
        rl.loop.Client(server.endpoint, key=tmp_path / "server.key", **keys)
    with pytest.raises(rl.ScenarioError, match="need each other"):
        rl.loop.Security(server_key=tmp_path / "server.key_secret")


@pytest.mark.parametrize("has_ipc", [True, False])
def test_the_gateway_is_met_by_a_socket_of_files_where_there_are_such(scenario, monkeypatch, has_ipc):
    bound, bind = [], zmq.Socket.bind
    monkeypatch.setattr(zmq, "has", lambda what: has_ipc and what == "ipc")
    monkeypatch.setattr(zmq.Socket, "bind", lambda self, address: bound.append(address) or bind(self, address))
    with serving(scenario) as server, rl.loop.Client(server.endpoint, timeout_s=30) as client:
        assert client.step().index == 0
    assert any(str(address).startswith("ipc://") for address in bound) == has_ipc
