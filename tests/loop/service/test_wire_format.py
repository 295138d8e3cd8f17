"""Messages: arrays of every order arrive as they were, and a message that describes them wrongly is refused in one line."""

import json

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.loop.service.requests import SCHEMA
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
