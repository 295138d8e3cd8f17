"""What `import rso_lidar as rl` offers: what scripts build and run, and where the rest is."""

import importlib
import pkgutil
from itertools import permutations

import pytest

import rso_lidar as rl


def test_rl_shows_what_it_offers_and_nothing_else():
    assert sorted(rl.__all__) == sorted(set(rl.__all__))
    assert set(dir(rl)) == {*rl.__all__, "__doc__", "__version__"}
    assert all(getattr(rl, name) is not None for name in rl.__all__)


def test_rooms_show_what_they_export_and_nothing_else():
    rooms = [importlib.import_module(f"rso_lidar.{it.name}") for it in pkgutil.iter_modules(rl.__path__) if it.ispkg]
    assert len(rooms) > 10
    assert not {room.__name__: names for room in rooms if (names := set(dir(room)) ^ set(room.__all__))}


def test_no_two_names_of_rl_look_alike():
    alike = [
        (short, long)
        for short, long in permutations(rl.__all__, 2)
        if long.lower().startswith(short.lower()) and len(long) - len(short) <= 3
    ]
    assert not alike


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("Lambert", "rpo.Lambert"),
        ("Epochs", "orbit.Epochs"),
        ("Table", "motion.Table"),
        ("Ggx", "scene.Ggx"),
        ("GaussianPsf", "optics.GaussianPsf"),
        ("Amplifier", "detector.Amplifier"),
        ("Truth", "records.Truth"),
        ("Tracking", "study.Tracking"),
        ("Pointing", "track.Pointing"),
    ],
)
def test_a_name_that_lives_in_a_room_is_found_there(name, place):
    room, member = place.split(".")
    assert hasattr(getattr(rl, room), member)
    with pytest.raises(AttributeError, match=rf"no attribute '{name}': rl\.{name} is rl\.{place}$"):
        getattr(rl, name)


def test_what_is_nowhere_is_no_attribute():
    with pytest.raises(AttributeError, match=r"no attribute 'Lambertine'$"):
        _ = rl.Lambertine
