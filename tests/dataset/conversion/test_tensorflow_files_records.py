"""TFRecord: checksums, framing and messages, byte by byte."""

import struct

import numpy as np
import pytest

from rso_lidar.dataset.conversion.tensorflow_files import compute_crc32c, encode_example, frame_record
from rso_lidar.kernels import packed
from tests.reference.dataset import tensorflow_records as oracle


def checksum(content):
    return int(compute_crc32c(packed(np.frombuffer(content, np.uint8))))


@pytest.mark.parametrize(
    ("content", "expected"),
    [  # RFC 3720, appendix B.4: the checksums are printed there byte by byte, the lowest first
        (bytes(32), 0x8A9136AA),
        (b"\xff" * 32, 0x62A8AB43),
        (bytes(range(32)), 0x46DD794E),
        (bytes(range(31, -1, -1)), 0x113FDB5C),
        (b"123456789", 0xE3069283),
    ],
)
def test_checksums_are_those_of_the_standard(content, expected):
    assert checksum(content) == oracle.compute_crc32c(content) == expected


def test_checksums_of_random_bytes_agree_with_the_oracle():
    rng = np.random.default_rng(4)
    for size in (0, 1, 7, 300):
        content = rng.bytes(size)
        assert checksum(content) == oracle.compute_crc32c(content)


def test_a_record_is_framed_as_tensorflow_frames_it():
    """The bytes that `tf.io.TFRecordWriter` of TensorFlow 2.21 wrote."""
    assert frame_record(b"flash lidar").hex() == "0b000000000000008615f504666c617368206c69646172245ab81b"


def test_a_message_is_encoded_as_tensorflow_encodes_it():
    """The bytes of `tf.train.Example.SerializeToString` of TensorFlow 2.21."""
    assert encode_example({"n": np.array([300, 5])}).hex() == "0a0e0a0c0a016e12071a050a03ac0205"


def test_negative_numbers_floats_and_texts():
    message = encode_example({"a": np.array(-1, np.int8), "b": np.float64(0.5), "c": "é"})
    assert b"\xff" * 9 + b"\x01" in message  # two's complement in ten bytes
    assert struct.pack("<f", 0.5) in message and "é".encode() in message
    assert message.index(b"\x0a\x01a") < message.index(b"\x0a\x01b") < message.index(b"\x0a\x01c")
