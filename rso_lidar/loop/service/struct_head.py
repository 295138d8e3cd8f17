"""The head of a reply as structures of C in place of the JSON object, for processors without a parser of JSON."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.loop.service.wire_format import WireArray, to_little_endian

# The fields of docs/protocol.md, in their order: little-endian, each at a multiple of its size.
_HEAD = struct.Struct("<4s4B2Q4qQ6I")
_ENTRY = struct.Struct("<I4s6I")
_MAGIC, _VERSION = b"RSOL", 1
_REPLIES = ("error", "hello", "describe", "step", "reset", "observation", "truth", "save", "restore", "shutdown")
_STATUSES = (None, "delivered", "dropped", "skipped")
_CODES = (None, "bad_request", "no_session", "busy", "forbidden", "failed")
_MOST_DIMS = 4
_OK, _OVER = 1, 2


def encode_struct(header: dict[str, Any], arrays: Sequence[WireArray] = ()) -> list[Any]:
    """Return the parts of a message: the head as structures of C, then the bytes of each array.

    Parameters
    ----------
    header : of the message, as for `wire_format.encode`. What the structures have no field for is left out

    Returns
    -------
    parts of the message

    Raises
    ------
    ScenarioError
        If an array has more than four dimensions, as only the samples of a user's sensor may have.
    """
    packed = [to_little_endian(array.values) for array in arrays]
    texts, at = [], _HEAD.size + _ENTRY.size * len(packed)

    def place(text: str) -> int:
        """Add a text that ends with a zero byte, and return its offset in the head."""
        nonlocal at
        begin = at
        texts.append(text.encode() + b"\0")
        at += len(texts[-1])
        return begin

    entries = []
    for number, (array, values) in enumerate(zip(arrays, packed, strict=True), 1):
        if values.ndim > _MOST_DIMS:
            raise ScenarioError(
                f"{array.path}: has {values.ndim} dimensions, and a struct has four; ask for a JSON head"
            )
        shape = values.shape + (1,) * (_MOST_DIMS - values.ndim)
        dtype = values.dtype.str.encode()
        entries.append(_ENTRY.pack(place(array.path), dtype, values.ndim, *shape, number))
    frame, error = header.get("frame") or {}, header.get("error") or {}
    fixed = _HEAD.pack(
        _MAGIC,
        _VERSION,
        _REPLIES.index(header["reply"]),
        _STATUSES.index(frame.get("status")),
        _OK * header["ok"] | _OVER * header.get("is_over", False),
        header["sequence"],
        header["request_sequence"],
        header.get("time_ns", -1),
        _or_less(header.get("next_flash_ns")),
        _or_less(frame.get("t_emission_ns")),
        _or_less(frame.get("t_available_ns")),
        header.get("seed", int(header.get("state", "state-0").rpartition("-")[2])),
        frame.get("index", 0),
        header.get("overruns", 0),
        header.get("dropped", 0),
        _CODES.index(error.get("code")),
        place(error["message"]) if error else 0,
        len(packed),
    )
    head = b"".join([fixed, *entries, *texts])
    return [head + bytes(-len(head) % 8), *[values.data if values.size else b"" for values in packed]]


def _or_less(time_ns: int | None) -> int:
    """Return a time [ns], or -1 for none."""
    return -1 if time_ns is None else time_ns
