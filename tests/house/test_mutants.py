"""The list of planted faults cannot rot: each still finds its place in the code as it is now."""

from collections import Counter

from tests.mutants.faults import load

FAULTS = load()


def test_every_fault_can_be_planted():
    assert not [problem for fault in FAULTS for problem in fault.problems()]


def test_every_fault_has_a_name_of_its_own():
    assert not [name for name, count in Counter(map(str, FAULTS)).items() if count > 1]


def test_every_room_of_the_walk_has_faults():
    rooms = {"optics", "scene", "detector", "motion", "orbit", "rpo", "export", "sensors", "simulation"}
    assert rooms <= {fault.room for fault in FAULTS}
    for fault in FAULTS:
        assert fault.file.startswith(f"rso_lidar/{fault.room}"), str(fault)
