"""Embree by ctypes: acceleration structures for packets of rays, from the library inside embreex's wheel.

embreex passes one ray after another to embree. Rays through neighbouring pixels hit neighbouring facets. In packets of 16,
8 or 4, whichever the processor has instructions for, they take a third of the time. Where the library is not found, or is
not Embree 4, embreex answers ray by ray. Prototypes and constants are those of the headers of Embree 4.4 (rtcore_device.h,
rtcore_scene.h, rtcore_geometry.h, rtcore_buffer.h).
"""

import ctypes
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple
from weakref import finalize

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.scene.embree.ray_by_ray import EmbreexScene, RayByRay

_VERSION_MAJOR = 4
_PROPERTY_VERSION = 0
_PROPERTY_NATIVE = {16: 34, 8: 33, 4: 32}  # packet widths that the processor has instructions for, widest first
_TRIANGLES, _BUFFER_INDEX, _BUFFER_VERTEX = 0, 0, 1
_FORMAT_UINT3, _FORMAT_FLOAT3 = 0x5003, 0x9003
_ROBUST = 4  # no ray slips between two facets, at a cost of 5 %
_OUT_OF_MEMORY = 4
_QUESTIONS = ("Intersect", "Occluded")

_POINTER, _INT, _UINT, _SIZE = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint, ctypes.c_size_t
_PROTOTYPES: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (_POINTER, [ctypes.c_char_p]),
    "rtcGetDeviceError": (_INT, [_POINTER]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_POINTER, _INT]),
    "rtcNewScene": (_POINTER, [_POINTER]),
    "rtcSetSceneFlags": (None, [_POINTER, _INT]),
    "rtcCommitScene": (None, [_POINTER]),
    "rtcReleaseScene": (None, [_POINTER]),
    "rtcNewGeometry": (_POINTER, [_POINTER, _INT]),
    "rtcSetNewGeometryBuffer": (_POINTER, [_POINTER, _INT, _UINT, _INT, _SIZE, _SIZE]),
    "rtcCommitGeometry": (None, [_POINTER]),
    "rtcAttachGeometry": (_UINT, [_POINTER, _POINTER]),
    "rtcReleaseGeometry": (None, [_POINTER]),
}
_finding = Lock()


class Embree(NamedTuple):
    """Embree: its functions, a device, the number of rays in a packet, and the addresses of its two queries."""

    library: Any
    device: int
    width: int
    intersect: int
    occluded: int

    @property
    def summary(self) -> str:
        """How rays are cast, in words for a recording."""
        return f"packets of {self.width} rays"

    def build(self, triangles: np.ndarray) -> "PacketScene":
        """Build the acceleration structure of triangles (facet, corner, xyz) [m]."""
        return PacketScene(self, triangles)

    def check(self) -> None:
        """Raise an error that occurred during a query. Embree's queries have none."""


class PacketScene:
    """The committed acceleration structure of one surface; `address` is valid while this object is referenced."""

    def __init__(self, engine: Embree, triangles: np.ndarray) -> None:
        """Build the acceleration structure of triangles (facet, corner, xyz) [m]."""
        call, device = engine.library, engine.device
        corners = np.ascontiguousarray(triangles.reshape(-1, 3), dtype=np.float32)
        index = np.arange(len(corners), dtype=np.uint32)
        self.address: int = call.rtcNewScene(device) or _raise_error(engine)
        finalize(self, call.rtcReleaseScene, self.address).atexit = False  # the end of the process frees everything
        call.rtcSetSceneFlags(self.address, _ROBUST)
        geometry = call.rtcNewGeometry(device, _TRIANGLES) or _raise_error(engine)
        try:
            for kind, form, values in (
                (_BUFFER_VERTEX, _FORMAT_FLOAT3, corners),
                (_BUFFER_INDEX, _FORMAT_UINT3, index.reshape(-1, 3)),
            ):
                # Embree allocates the buffer, with the padding that it reads.
                room = call.rtcSetNewGeometryBuffer(geometry, kind, 0, form, 12, len(values)) or _raise_error(engine)
                ctypes.memmove(room, values.ctypes.data, values.nbytes)
            call.rtcCommitGeometry(geometry)
            call.rtcAttachGeometry(self.address, geometry)
        finally:
            call.rtcReleaseGeometry(geometry)  # the scene holds it now
        call.rtcCommitScene(self.address)
        if code := call.rtcGetDeviceError(device):
            _raise_error(engine, code)


def _raise_error(engine: Embree, code: int | None = None) -> int:
    """Raise embree's error as an exception."""
    code = engine.library.rtcGetDeviceError(engine.device) if code is None else code
    if code == _OUT_OF_MEMORY:
        raise MemoryError("embree: no memory left for the acceleration structure of a mesh")
    raise MeshError(f"embree: cannot build the acceleration structure of a mesh (error {code}); check the mesh")


Engine = Embree | RayByRay
Scene = PacketScene | EmbreexScene


def engine() -> Engine:
    """Return embree with a device for this process, or where it is not found, what casts ray by ray."""
    with _finding:
        return _find_engine()


@lru_cache(maxsize=1)
def _find_engine() -> Engine:
    for path in _libraries():
        try:
            return open_engine(path)
        except (OSError, AttributeError, ValueError):
            continue
    return RayByRay()


def open_engine(path: Path, isa: str = "") -> Embree:
    """Load embree from a library's file, for the processor's own instructions or those of `isa`, such as "avx2".

    Raises
    ------
    OSError, AttributeError, ValueError : the file is not a library, not embree, or an embree of another version.
    """
    library = ctypes.CDLL(str(path))
    for name, (result, arguments) in _PROTOTYPES.items():
        function: Callable[..., Any] = getattr(library, name)
        function.restype, function.argtypes = result, arguments  # type: ignore[attr-defined]
    # One thread builds. The structure is then always the same, and a forked process waits for no thread.
    device = library.rtcNewDevice(("threads=1" + (f",isa={isa}" if isa else "")).encode())
    if not device:
        raise ValueError("embree cannot make a device")
    version = library.rtcGetDeviceProperty(device, _PROPERTY_VERSION)
    if version // 10_000 != _VERSION_MAJOR:
        raise ValueError(f"embree is version {version}, and records of rays differ between versions")
    for width, native in _PROPERTY_NATIVE.items():
        if library.rtcGetDeviceProperty(device, native):
            return Embree(library, device, width, *(_address(library, f"rtc{q}{width}") for q in _QUESTIONS))
    raise ValueError("embree does not support packets on this processor")


def _address(library: Any, name: str) -> int:
    return ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0


def _libraries() -> list[Path]:
    """Return the files in which wheels keep the embree that embreex has loaded."""
    import embreex
    import embreex.rtcore_scene  # loads embree, and what embree itself needs

    package = Path(embreex.__file__).parent
    rooms = (package.parent / "embreex.libs", package / ".dylibs", package)
    return [file for room in rooms for file in sorted(room.glob("*embree4*")) if file.is_file()]
