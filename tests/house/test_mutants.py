"""Planted faults cannot rot: each of the list finds its place in the code, and the sample is what its seed draws."""

from collections import Counter

import pytest

from tests.house.sources import without_garbage_collection
from tests.mutants import sample
from tests.mutants.faults import load

FAULTS = load()


def find_problems(faults):
    """Return why some faults cannot be planted."""
    with without_garbage_collection():  # each fault is parsed with its module
        return [problem for fault in faults for problem in fault.problems()]


def test_every_fault_can_be_planted():
    assert not find_problems(FAULTS)


def test_every_fault_has_a_name_of_its_own():
    assert not [name for name, count in Counter(map(str, FAULTS)).items() if count > 1]


def test_every_room_of_the_walk_has_faults():
    rooms = {"optics", "scene", "detector", "motion", "orbit", "rpo", "export", "sensors", "simulation"}
    assert rooms <= {fault.room for fault in FAULTS}
    for fault in FAULTS:
        assert fault.file.startswith(f"rso_lidar/{fault.room}"), str(fault)


@pytest.fixture(scope="module")
def drawn():
    with without_garbage_collection():
        return sample.draw()


def test_the_sample_can_be_planted_and_goes_over_the_whole_package(drawn):
    assert len(drawn) == sample.SIZE
    assert not find_problems(drawn)
    assert len({fault.room for fault in drawn}) > 20


def test_what_no_test_can_see_is_in_the_sample(drawn):
    assert not set(sample.equivalent()) - {fault.name for fault in drawn}
