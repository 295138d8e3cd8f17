"""Packets of rays as embree lays them out, and the two questions asked of them: what is met first, and whether anything.

A packet is a table of 4-byte words, one row for each quantity and one column for each ray (rtcore_ray.h, Embree 4.4:
RTCRayHit4, 8 and 16 differ in the columns only). Before it stand the words of RTCIntersectArguments, and which columns
hold a ray. This module is imported where its loops are used.
"""

from typing import Any

import numpy as np
from llvmlite import ir  # noqa: TID253  # a module of loops: see above
from numba import types  # noqa: TID253
from numba.extending import intrinsic  # noqa: TID253

from rso_lidar.arithmetic import loop

# Rows of a ray that are not left 0 (three of START, three of ALONG) ...
START, ALONG, FAR, MASK = 0, 4, 8, 9
# ... and of its hit. Behind come the numbers of instances, which some builds of embree keep on more levels than others.
FACET, GEOMETRY, ROWS = 17, 18, 40
# What stands before the packet, in words: arguments (flags, features, and pointers to nothing), then the columns in use.
BEFORE, USED = 32, 16
_ALIGNED = 64  # bytes
NOTHING = np.uint32(0xFFFFFFFF)
_COHERENT = np.uint32(1 << 16)  # rays side by side meet the same facets: embree follows them down together


@intrinsic
def _call(typing_context: Any, function: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return nothing, having called the C function at an address with four pointers."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word] * 4)
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    return types.void(types.intp, types.intp, types.intp, types.intp, types.intp), code


@loop
def packet(width: int) -> np.ndarray:
    """Return the words of an empty packet, aligned, and what stands before it."""
    room = np.zeros(BEFORE + ROWS * width + _ALIGNED // 4, np.uint32)
    first = (_ALIGNED - room.ctypes.data % _ALIGNED) % _ALIGNED // 4
    words = room[first : first + BEFORE + ROWS * width]
    words[0] = _COHERENT
    words[1] = NOTHING  # all features
    for k in range(width):
        words[BEFORE + MASK * width + k] = NOTHING
    return words


@loop
def ask(question: int, scene: int, words: np.ndarray, width: int, count: int) -> None:
    """Ask embree, at the address `question`, about the first `count` rays of a packet."""
    for k in range(width):
        words[USED + k] = NOTHING if k < count else np.uint32(0)
        words[BEFORE + GEOMETRY * width + k] = NOTHING
    at = words.ctypes.data
    _call(question, at + 4 * USED, scene, at + 4 * BEFORE, at)  # type: ignore[call-arg]


@loop
def add_met(
    met: np.ndarray,
    asked: np.ndarray,
    point: np.ndarray,
    facing: np.ndarray,
    off: float,
    toward: np.ndarray,
    reach: np.ndarray,
    origin: np.ndarray,
    turn: np.ndarray,
    sphere: np.ndarray,
    question: int,
    scene: int,
    width: int,
) -> None:
    """Set in `met` (ray) which of the rays `asked` for meet another surface within their reach [m].

    They start `off` [m] along `facing` from `point` and go `toward`, all (xyz, ray) in one surface's axes, of which
    `origin` [m] and `turn` make the other's; `sphere` is centre and radius [m] of one that holds the other. As the lidar's
    rays do, these start just before it, where float32 is fine.
    """
    words = packet(width)
    values = words.view(np.float32)[BEFORE:]
    rays, start, along = np.empty(width, np.int64), np.empty(3), np.empty(3)
    wide = 1.01 * sphere[3]
    count, n = 0, len(met)
    for i in range(n):
        if asked[i] and not met[i]:
            x, y, z = (
                point[0, i] + off * facing[0, i],
                point[1, i] + off * facing[1, i],
                point[2, i] + off * facing[2, i],
            )
            ahead = centre2 = 0.0
            for axis in range(3):
                row = turn[axis]
                start[axis] = origin[axis] + (row[0] * x + row[1] * y + row[2] * z)
                along[axis] = row[0] * toward[0, i] + row[1] * toward[1, i] + row[2] * toward[2, i]
                to_centre = sphere[axis] - start[axis]
                ahead += to_centre * along[axis]
                centre2 += to_centre * to_centre
            skipped = max(ahead - wide - 0.01, 0.0)
            if centre2 - ahead * ahead <= wide * wide + 1e-4 and ahead > -wide and skipped < reach[i]:
                for axis in range(3):
                    values[(START + axis) * width + count] = start[axis] + skipped * along[axis]
                    values[(ALONG + axis) * width + count] = along[axis]
                values[FAR * width + count] = reach[i] - skipped
                rays[count] = i
                count += 1
        if count == width or (i == n - 1 and count > 0):
            ask(question, scene, words, width, count)
            for k in range(count):
                met[rays[k]] = values[FAR * width + k] < 0.0  # embree's word for "something": minus infinity
            count = 0
