"""Messages: arrays of every order arrive as they were, and a message that describes them wrongly is refused in one line."""

import json

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.loop.service.requests import SCHEMA
from rso_lidar.loop.service.struct_head import encode_struct
from rso_lidar.loop.service.wire_format import WireArray, decode, encode
from rso_lidar.records import Reading, specs

zmq = pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")

SPEC = specs(Reading)["range_m"]
VALUES = np.arange(24.0).reshape(2, 3, 4)


@pytest.mark.parametrize(
    "values",
    [
        VALUES,
        VALUES.T,
        VALUES[:, ::-1, 1:3],
        VALUES.astype(">f8"),
        VALUES.astype(">i4").T,
        VALUES.astype("f4"),
        VALUES > 7.0,
        np.zeros((0, 3)),
        np.float64(7.5),
    ],
)
def test_every_order_of_bytes_and_memory_arrives_as_it_was(values):
    header, arrays = decode([bytes(part) for part in encode({"reply": "step"}, [WireArray("a/b", SPEC, values)])])
    assert header["reply"] == "step" and header["arrays"][0]["unit"] == "m"
    assert arrays["a/b"].dtype.newbyteorder("=") == np.asarray(values).dtype.newbyteorder("=")
    np.testing.assert_array_equal(arrays["a/b"], values, strict=False)
    assert not arrays["a/b"].flags.writeable


# The layout in docs/protocol.md and examples/flight_software/struct_head.h, stated once more.
HEAD = np.dtype("S4, u1, u1, u1, u1, <u8, <u8, <i8, <i8, <i8, <i8, <u8, <u4, <u4, <u4, <u4, <u4, <u4", align=True)
ENTRY = np.dtype([("name_at", "<u4"), ("dtype", "S4"), ("n_dims", "<u4"), ("shape", "<u4", 4), ("part", "<u4")])


def read_text(head, at):
    return head[at : head.index(b"\0", at)].decode()


def test_a_head_of_structures_says_what_the_json_head_says():
    frame = {"index": 7, "status": "delivered", "t_emission_ns": 5, "t_available_ns": 6, "settings": {"energy_j": 1.0}}
    state = {"time_ns": 2**62, "next_flash_ns": None, "is_over": True, "overruns": 1, "dropped": 2, "frame": frame}
    header = {"reply": "step", "ok": True, "sequence": 8, "request_sequence": 2**53, **state}
    arrays = [WireArray("reading/range_m", SPEC, VALUES.astype(">f4")), WireArray("b", SPEC, np.zeros((0, 3), "u2"))]
    head, *parts = map(bytes, encode_struct(header, arrays))
    assert HEAD.itemsize == 88 and ENTRY.itemsize == 32 and len(head) % 8 == 0
    fixed = np.frombuffer(head, HEAD, 1)[0].item()
    assert fixed == (b"RSOL", 1, 3, 1, 3, 8, 2**53, 2**62, -1, 5, 6, 0, 7, 1, 2, 0, 0, 2)
    entries = np.frombuffer(head, ENTRY, 2, 88)
    assert [read_text(head, entry["name_at"]) for entry in entries] == ["reading/range_m", "b"]
    assert [(entry["dtype"], entry["shape"].tolist(), entry["n_dims"], entry["part"]) for entry in entries] == [
        (b"<f4", [2, 3, 4, 1], 3, 1),
        (b"<u2", [0, 3, 1, 1], 2, 2),
    ]
    assert parts == [VALUES.astype("<f4").tobytes(), b""]
    error = {"code": "busy", "message": "wait, \N{MICRO SIGN}"}
    (head,) = map(
        bytes, encode_struct({"reply": "error", "ok": False, "sequence": 1, "request_sequence": 2, "error": error})
    )
    fixed = np.frombuffer(head, HEAD, 1)[0].item()
    assert fixed[1:8] == (1, 0, 0, 0, 1, 2, -1) and fixed[15] == 3 and read_text(head, fixed[16]) == error["message"]
    for header, value in (
        ({"reply": "save", "state": "state-12"}, 12),
        ({"reply": "reset", "seed": 2**63 - 1}, 2**63 - 1),
    ):
        (head,) = encode_struct({"ok": True, "sequence": 1, "request_sequence": 2} | header)
        assert np.frombuffer(head, HEAD, 1)[0].item()[11] == value
    with pytest.raises(rl.ScenarioError, match="ask for a JSON head"):
        encode_struct(
            {"reply": "step", "ok": True, "sequence": 1, "request_sequence": 2},
            [WireArray("c", SPEC, np.zeros([1] * 5))],
        )


def test_numbers_that_are_not_finite_are_null():
    text = encode({"settings": {"a_s": np.inf, "b_s": np.float64("nan"), "c_s": 2.5}})[0].decode()
    assert json.loads(text, parse_constant=pytest.fail)["settings"] == {"a_s": None, "b_s": None, "c_s": 2.5}


@pytest.mark.parametrize(
    ("listed", "part"),
    [
        ({"dtype": "<f8", "shape": [3]}, b"1234567812345678"),
        ({"dtype": "<f8", "shape": [-1]}, b"12345678"),
        ({"dtype": "<f8", "shape": [0, 10**30]}, b""),
        ({"dtype": "<f8", "shape": [0] * 70}, b""),
        ({"dtype": "<f8", "shape": ["one"]}, b"12345678"),
        ({"dtype": "|O", "shape": [1]}, b"12345678"),
        ({"dtype": "x" * 5000, "shape": [1]}, b"12345678"),
        ({"shape": [1]}, b"12345678"),
        (7, b""),
    ],
)
def test_a_message_with_a_false_description_of_an_array(listed, part):
    entry = {"name": "range_m"} | listed if isinstance(listed, dict) else listed
    text = json.dumps({"schema": SCHEMA, "arrays": [entry]}).encode()
    with pytest.raises(rl.RunError, match="does not fit its") as caught:
        decode([text, part])
    assert len(str(caught.value)) < 200
