"""What is derived from a surface's geometry alone: computed once, and shared by all surfaces of the same geometry."""

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import Generic, TypeVar

from rso_lidar.scene.surfaces.surface import Surface

_MOST_GEOMETRIES = 64  # targets of a scenario or a study; beyond that the least recently used is computed again
_Derived = TypeVar("_Derived")


class GeometryCache(Generic[_Derived]):
    """Calls a function of a surface once for each geometry, also from several threads."""

    def __init__(self, derive: Callable[[Surface], _Derived]) -> None:
        """Make an empty cache.

        Parameters
        ----------
        derive : computes the value of a surface; it may depend on the corners of the facets only
        """
        self._derive = derive
        self._known: OrderedDict[str, _Derived] = OrderedDict()  # by the hash of the geometry
        self._lock = Lock()

    def get(self, surface: Surface) -> _Derived:
        """Return the value of a surface's geometry."""
        with self._lock:
            if surface.content not in self._known:
                self._known[surface.content] = self._derive(surface)
                while len(self._known) > _MOST_GEOMETRIES:
                    self._known.popitem(last=False)
            self._known.move_to_end(surface.content)
            return self._known[surface.content]
