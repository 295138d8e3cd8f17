"""Packets of rays in embree's layout, and its two queries: the first hit, and whether there is any hit.

A packet is a table of 4-byte words, one row for each quantity and one column for each ray (rtcore_ray.h, Embree 4.4:
RTCRayHit4, 8 and 16 differ in the columns only). The words of RTCIntersectArguments precede it. A mask of the columns that
hold a ray follows it.
"""

import ctypes
from functools import cached_property
from typing import Any

import numpy as np

from rso_lidar.kernels import kernel

# Rows of a ray that are not 0 (three of START, three of ALONG) ...
START, ALONG, FAR, MASK = 0, 4, 8, 9
# ... and of its hit. Instance numbers follow, on more levels in some builds of embree than in others.
FACET, GEOMETRY, ROWS = 17, 18, 40
BEFORE = 16  # words before the packet: flags, features, and pointers to nothing
_ALIGNED = 64  # bytes
NOTHING = np.uint32(0xFFFFFFFF)
_COHERENT = np.uint32(1 << 16)  # neighbouring rays hit the same facets: embree traverses them together


class _CallAddress:
    """Calls the C function at an address with four pointers. In a compiled kernel this is an intrinsic of numba."""

    def __call__(self, address: int, *pointers: int) -> None:
        """Call the function from Python, where kernels are not compiled."""
        ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(int(address))(*map(int, pointers))

    @cached_property
    def _numba_type_(self) -> Any:
        """Type of the intrinsic, which is made when a kernel that calls it is compiled."""
        from llvmlite import ir
        from numba import types
        from numba.core.registry import cpu_target
        from numba.extending import intrinsic

        def call(typing_context: Any, function: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
            def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
                word = ir.IntType(64)
                kind = ir.FunctionType(ir.VoidType(), [word] * 4)
                builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
                return context.get_dummy_value()

            return types.void(*[types.intp] * 5), code

        known = cpu_target.typing_context
        call_intrinsic = intrinsic(call)
        known.refresh()  # the compiler is running: it has to see the new intrinsic
        return known.resolve_value_type(call_intrinsic)


_call = _CallAddress()


@kernel
def make_packet(width: int) -> np.ndarray:
    """Make an empty, aligned packet, with what precedes and follows it."""
    size = BEFORE + (ROWS + 1) * width
    room = np.zeros(size + _ALIGNED // 4, np.uint32)
    first = (_ALIGNED - room.ctypes.data % _ALIGNED) % _ALIGNED // 4
    words = room[first : first + size]
    words[0] = _COHERENT
    words[1] = NOTHING  # all features
    for k in range(width):
        words[BEFORE + MASK * width + k] = NOTHING
    return words


@kernel
def ask(question: int, scene: int, words: np.ndarray, width: int, count: int) -> None:
    """Query embree about the first rays of a packet."""
    used = BEFORE + ROWS * width
    for k in range(width):
        words[used + k] = NOTHING if k < count else np.uint32(0)
        words[BEFORE + GEOMETRY * width + k] = NOTHING
    at = words.ctypes.data
    _call(question, at + 4 * used, scene, at + 4 * BEFORE, at)
