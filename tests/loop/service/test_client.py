"""The client in front of a server that answers wrongly: one line, and no KeyError."""

import json
import threading
from contextlib import contextmanager

import pytest

import rso_lidar as rl
from rso_lidar.loop.service.requests import SCHEMA

zmq = pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")

STATE = {"schema": SCHEMA, "ok": True, "time_ns": 0, "next_flash_ns": 0, "is_over": False, "overruns": 0, "arrays": []}
HELLO = STATE | {"describe": {"title": "a server of these tests"}}


@contextmanager
def answering(*headers):
    """Answer each request with the next header, and yield the address."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as plug:
        plug.rcvtimeo, plug.linger = 20_000, 0
        port = plug.bind_to_random_port("tcp://127.0.0.1")

        def answer():
            for header in headers:
                identity, empty, request = plug.recv_multipart()
                number = {"request_sequence": json.loads(request)["sequence"]}
                text = header if isinstance(header, bytes) else json.dumps(header | number).encode()
                plug.send_multipart([identity, empty, text])

        thread = threading.Thread(target=answer)
        thread.start()
        yield f"tcp://127.0.0.1:{port}"
        thread.join(20)
        assert not thread.is_alive()


def without(header, name):
    return {key: value for key, value in header.items() if key != name}


@pytest.mark.parametrize(
    ("header", "error"),
    [
        (without(HELLO, "ok"), "the reply lacks 'ok'; use equal versions"),
        (without(HELLO, "describe"), "the reply lacks 'describe'"),
        (without(HELLO, "time_ns"), "the reply lacks 'time_ns'"),
        (HELLO | {"describe": 7}, "the reply cannot be read"),
        (HELLO | {"next_flash_ns": "soon"}, "the reply cannot be read"),
        (STATE | {"ok": False}, "the reply lacks 'error'"),
        (STATE | {"ok": False, "error": {"code": "busy"}}, "the reply lacks 'message'"),
        (json.dumps(HELLO).encode("utf-16"), "none of an rso-lidar server"),
        (b"hello", "none of an rso-lidar server"),
    ],
)
def test_a_wrong_answer_to_the_first_request(header, error):
    with answering(header) as endpoint, pytest.raises(rl.RunError, match=error) as caught:
        rl.loop.Client(endpoint, timeout_s=20)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "header", "error"),
    [
        ("step", STATE, "the reply lacks 'frame'"),
        ("step", STATE | {"frame": {"index": 0}}, "the reply lacks 'status'"),
        ("step", STATE | {"frame": None, "records": ["sensors/imu"]}, "the reply cannot be read"),
        ("step", STATE | {"frame": None, "records": {"sensors/imu": "GyroSamples"}}, "the reply cannot be read"),
        ("save", STATE, "the reply lacks 'state'"),
        ("truth", STATE | {"parents": {"inertial": None}}, "the reply lacks"),
    ],
)
def test_a_wrong_answer_later(kind, header, error):
    with answering(HELLO, header) as endpoint, rl.loop.Client(endpoint, timeout_s=20) as client:
        assert client.description == HELLO["describe"] and client.next_flash_s == 0.0
        with pytest.raises(rl.RunError, match=error):
            client.truth if kind == "truth" else getattr(client, kind)()
