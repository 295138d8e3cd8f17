"""Streams of the run-length DEFLATE are read back by zlib, and are as small as zlib's own of that kind."""

import zlib

import numpy as np
import pytest

from rso_lidar.export.writer.deflate import bound_stream, deflate_planes, find_codes
from rso_lidar.kernels import packed

DTYPES = ("f8", "f4", "i4", "i2", "u2", "u1")
SHAPES = ((1, 1), (3, 3), (7, 5), (128, 128), (130, 257))


def planes(image):
    """Return the bytes of an image as HDF5's filter shuffle arranges them."""
    return np.ascontiguousarray(image.reshape(-1).view(np.uint8).reshape(-1, image.itemsize).T).tobytes()


def deflated(image):
    data = packed(image.reshape(-1).view(np.uint8))
    words = data[: len(data) // 8 * 8].view(np.uint64)
    out = np.zeros(bound_stream(len(data)), np.uint8)
    scratch = np.empty(len(data), np.int64), np.empty(len(data), np.uint16)
    return out[: deflate_planes(data, words, image.itemsize, *scratch, out)].tobytes()


def draw(kind, shape, dtype):
    """Return an image: empty, mostly empty, of every second column, of random numbers, or of random bytes."""
    rng = np.random.default_rng(20240917)
    numbers = rng.integers(1, 120, shape).astype(dtype)
    masks = {"empty": np.zeros(shape, bool), "sparse": rng.random(shape) < 0.05, "numbers": np.ones(shape, bool)}
    masks["columns"] = np.broadcast_to(np.arange(shape[1]) % 2 == 1, shape)
    if kind == "bytes":
        return np.frombuffer(rng.bytes(numbers.nbytes), dtype).reshape(shape)
    return np.where(masks[kind], numbers, np.asarray(-1).astype(dtype))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("kind", ["empty", "sparse", "columns", "numbers", "bytes"])
def test_zlib_reads_what_was_written(kind, dtype):
    for shape in SHAPES:
        image = draw(kind, shape, dtype)
        assert zlib.decompress(deflated(image)) == planes(image), shape


@pytest.mark.parametrize("dtype", DTYPES)
def test_streams_are_as_small_as_those_of_zlib(dtype):
    image = draw("sparse", (128, 128), dtype)
    squeeze = zlib.compressobj(1, strategy=zlib.Z_RLE)
    assert len(deflated(image)) <= 1.01 * len(squeeze.compress(planes(image)) + squeeze.flush())


def test_nan_and_negative_zero_keep_their_bits():
    image = np.full((16, 16), np.nan)
    image[3], image[4, ::2], image[5] = 0.0, -0.0, np.frombuffer(b"\1\0\0\0\0\0\xf8\x7f")[0]  # another NaN
    assert zlib.decompress(deflated(image)) == planes(image)


@pytest.mark.parametrize("longest", [7, 15])
def test_codes_are_complete_and_short_enough(longest):
    fibonacci = [1, 1]
    while len(fibonacci) < 19:
        fibonacci.append(fibonacci[-1] + fibonacci[-2])  # the frequencies that make the longest codes
    frequencies = np.array(fibonacci)
    lengths, codes = np.zeros(19, np.int64), np.zeros(19, np.int64)
    find_codes(frequencies, longest, lengths, codes)
    assert lengths.min() > 0 and lengths.max() == longest
    assert np.sum(0.5**lengths) == 1.0  # Kraft's sum: no sequence of bits is without a meaning
    written = {format(code, f"0{length}b")[::-1] for code, length in zip(codes, lengths, strict=True)}
    assert not any(one != other and other.startswith(one) for one in written for other in written)


def test_codes_are_as_short_as_huffmans():
    frequencies = np.array([50, 0, 25, 12, 6, 3, 2, 1, 1])
    lengths, codes = np.zeros(9, np.int64), np.zeros(9, np.int64)
    find_codes(frequencies, 15, lengths, codes)
    assert lengths.tolist() == [1, 0, 2, 3, 4, 5, 6, 7, 7]
