"""Values of a geometry are computed once, shared by surfaces of the same corners, and dropped when many others follow."""

from rso_lidar.scene.surfaces.geometry_cache import GeometryCache
from tests.optics.bench_for_tests import plate, surface


def test_one_geometry_is_computed_once_and_the_oldest_of_many_again():
    computed = []
    cache = GeometryCache(lambda one: computed.append(one.name) or len(computed))
    assert [cache.get(surface(name, plate(2.0))) for name in ("a", "b")] == [1, 1]
    for number in range(64):
        cache.get(surface(f"other {number}", plate(3.0 + number)))
    assert cache.get(surface("c", plate(2.0))) == 66
    assert computed[0] == "a" and computed[-1] == "c"
