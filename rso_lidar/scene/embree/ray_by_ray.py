"""Queries answered by embreex, one ray after another, where embree's library is not found.

Kernels call embree at an address. Here that address belongs to a Python function, which reads the packet, calls embreex,
and writes the answer where embree would. It takes some three times as long.
"""

import ctypes
import itertools
from collections.abc import Callable
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from rso_lidar.scene.embree.packets import ALONG, FACET, FAR, GEOMETRY, ROWS, START

_WIDTH = 256  # rays in a packet: many, because each call from a kernel to Python costs some 20 us
_Question = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)


class EmbreexScene:
    """The acceleration structure of one surface in embreex; `address` is its number while this object is referenced."""

    def __init__(self, triangles: np.ndarray) -> None:
        """Build the acceleration structure of triangles (facet, corner, xyz) [m]."""
        self.run = build_embreex(triangles).run
        self.address = next(_numbers)
        _scenes[self.address] = self


_scenes: WeakValueDictionary[int, EmbreexScene] = WeakValueDictionary()
_numbers = itertools.count(1)


def build_embreex(triangles: np.ndarray) -> Any:
    """Build embreex's acceleration structure of triangles (facet, corner, xyz) [m], and commit it."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    corners = triangles.astype(np.float32)
    TriangleMesh(scene, corners)
    outside = (corners.max(axis=(0, 1)) + 1.0)[None]
    scene.run(outside, np.array([[1.0, 0.0, 0.0]], dtype=np.float32))  # the first ray commits the scene, in one thread
    return scene


class RayByRay:
    """The queries of `Embree`, for the same packets, answered by embreex."""

    width = _WIDTH
    summary = "one ray at a time"

    def __init__(self) -> None:
        # A C function cannot raise. An error is kept, and raised when the kernel has returned.
        self._errors: list[BaseException] = []
        self._functions = tuple(_Question(self._guard(answer)) for answer in (_find_first, _find_any))
        self.intersect, self.occluded = (
            ctypes.cast(function, ctypes.c_void_p).value or 0 for function in self._functions
        )

    def build(self, triangles: np.ndarray) -> EmbreexScene:
        """Build the acceleration structure of triangles (facet, corner, xyz) [m]."""
        return EmbreexScene(triangles)

    def check(self) -> None:
        """Raise an error that occurred during a query."""
        if self._errors:
            raise self._errors.pop()

    def _guard(self, answer: Callable[[EmbreexScene, np.ndarray, int], None]) -> Callable[[int, int, int, int], None]:
        def answer_packet(used: int, scene: int, packet: int, arguments: int) -> None:
            """Answer one packet, and keep an exception for the caller because none may cross the C interface.

            Parameters
            ----------
            used : address of the mask of rays (ray) i4
            scene : number of the scene
            packet : address of the packet
            arguments : not used
            """
            try:
                count = int(np.count_nonzero((ctypes.c_uint32 * _WIDTH).from_address(used)))
                words = np.ctypeslib.as_array((ctypes.c_float * (ROWS * _WIDTH)).from_address(packet))
                answer(_scenes[scene], words.reshape(ROWS, _WIDTH)[:, :count], count)
            except BaseException as error:
                self._errors.append(error)

        return answer_packet


def _rays(packet: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return origins (ray, xyz), directions (ray, xyz) and lengths (ray) of rays, as embreex takes them."""
    start, along = (np.ascontiguousarray(packet[row : row + 3].T) for row in (START, ALONG))
    return start, along, np.ascontiguousarray(packet[FAR])


def _find_first(scene: EmbreexScene, packet: np.ndarray, count: int) -> None:
    """Find the first hit of each ray, and write it into the packet.

    Parameters
    ----------
    packet : (row, ray) f4, in the layout of embree's packets
    count : number of rays
    """
    hits = scene.run(*_rays(packet), query="INTERSECT", output=1)
    met = hits["primID"] >= 0
    packet[FACET, met] = hits["primID"][met].astype(np.uint32).view(np.float32)
    packet[GEOMETRY, met] = 0.0
    packet[FAR, met] = hits["tfar"][met]


def _find_any(scene: EmbreexScene, packet: np.ndarray, count: int) -> None:
    """Find whether each ray is blocked, and mark it in the packet.

    Parameters
    ----------
    packet : (row, ray) f4, in the layout of embree's packets
    count : number of rays
    """
    packet[FAR, scene.run(*_rays(packet), query="OCCLUDED") >= 0] = -np.inf
