"""SGP4 through our own reader and state function: Vallado's whole verification set, and messages against each other."""

import re

import numpy as np
import pytest

from rso_lidar.errors import PropagationError
from rso_lidar.orbit import Catalog, Epochs, Fleet, propagate_sgp4
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.teme import REASONS, describe_failure, find_failures, propagate_in_teme

SOURCE = "Vallado et al., AIAA 2006-6753, tcppver.out"
# The sgp4 package's own list (its tests.py), in the order of the file: where his program breaks off, and why.
ERRORS = {22312: 1, 28350: 1, 28872: 6, 29141: 6, 33333: 4, 33334: 3, 20413: 6}


@pytest.fixture(scope="module")
def text(shared):
    return (shared / "tle" / "sgp4_verification" / "SGP4-VER.TLE").read_text()


@pytest.fixture(scope="module")
def cases(text, shared):
    """Return for each case: its element set as read from his file, his time span and his printed rows."""
    sets = parse_lines(text.split("\n"), "SGP4-VER.TLE")
    spans = [tuple(map(float, line[69:].split())) for line in text.splitlines() if line.startswith("2 ")]
    blocks = []
    for line in (shared / "tle" / "sgp4_verification" / "tcppver.out").read_text().splitlines():
        if line.endswith("xx"):
            blocks.append((int(line.split()[0]), []))
        else:
            blocks[-1][1].append([float(field) for field in line.split()[:7]])
    assert [entry.norad_id for entry in sets] == [number for number, _ in blocks]
    return [(entry, span, np.array(rows)) for entry, span, (_, rows) in zip(sets, spans, blocks, strict=True)]


def test_his_file_is_read_as_it_stands(text):
    """Comments, columns after the 69th, 33 sets, one of them twice; three were altered by hand, and their checksums tell."""
    catalog = Catalog.from_text(text, "SGP4-VER.TLE")
    assert len(catalog) == 29
    assert len(catalog.problems) == 3
    assert catalog.duplicates == 1  # 20413 stands there twice, with two time spans
    for problem, number in zip(catalog.problems, (33333, 33334, 33335), strict=True):
        assert re.match(r"SGP4-VER\.TLE: line \d+: wrong checksum", problem), number


def test_every_case(validation, cases):
    off_m, off_m_s = [], []
    for elements, _, rows in cases:
        if len(rows) == 1:
            continue  # his program prints the state of the satellite before where the first epoch fails: see below
        position_m, velocity_m_s, error = propagate_in_teme(elements, Epochs(elements.epoch_utc, rows[:, 0] * 60.0))
        assert not error.any()
        off_m.append(position_m - rows[:, 1:4] * 1e3)
        off_m_s.append(velocity_m_s - rows[:, 4:7] * 1e3)
        # all of a case's epochs in one call of a fleet, too
        many = Fleet([elements], elements.epoch_utc).grid(np.zeros(1, int), rows[:, 0] * 60.0)
        np.testing.assert_array_equal(many[0][0], position_m)
    compared = sum(map(len, off_m))
    assert (len(off_m), compared > 600) == (len(cases) - 1, True)
    # printed to 1e-8 km and 1e-9 km/s; other compilers differ by up to 0.2 mm, the sgp4 package's own allowance
    for what, off, tolerance, unit in [("position", off_m, 0.2, "mm"), ("velocity", off_m_s, 2e-3, "mm/s")]:
        validation(
            case=f"Vallado's file as a catalogue, {len(off)} cases, {compared} states in TEME: {what}, worst coordinate",
            source=SOURCE,
            expected=0.0,
            got=np.abs(np.concatenate(off)).max() * 1e3,
            tolerance=tolerance,
            unit=unit,
        )


def test_the_cases_that_are_meant_to_fail(validation, cases):
    """At the first epoch that he does not print, our words name the satellite, the epoch and the reason."""
    told = {}
    for elements, (start, stop, step), rows in cases:
        minutes = np.append(np.arange(start, stop, step), stop)
        after = minutes[minutes > rows[-1, 0]] if len(rows) > 1 else minutes
        if not len(after):
            continue
        epochs = Epochs(elements.epoch_utc, after[:1] * 60.0)
        position_m, velocity_m_s, error = propagate_in_teme(elements, epochs)
        bad = find_failures(position_m, velocity_m_s, error)
        assert bad.all()
        told[elements.norad_id] = describe_failure(elements, epochs, bad, error)
        if abs(after[0]) < 1440.0 * 7:
            with pytest.raises(PropagationError) as caught:
                propagate_sgp4(elements, epochs)
            assert str(caught.value) == told[elements.norad_id]
    assert set(told) == set(ERRORS)
    right = [
        number
        for number, message in told.items()
        if f"NORAD {number}: SGP4 has no state at 1 of 1 epochs" in message
        and f"{REASONS[ERRORS[number]]}, SGP4 error {ERRORS[number]}" in message
        and re.search(r"time_s = [-\d.e+]+: .* epoch \d{4}-\d\d-\d\dT\d\d:\d\dZ", message)
    ]
    validation(
        case="element sets that decay or break down: refused in words, with his error, where he stops",
        source="Vallado et al., AIAA 2006-6753; sgp4 package",
        expected=len(ERRORS),
        got=len(right),
        tolerance=0,
        unit="sets",
    )


def test_samples_of_messages_fly_alike(validation, shared):
    """The sgp4 package's samples: one object, the same message in CSV and XML, a later one in JSON."""
    folder = shared / "tle" / "sgp4_verification"
    (table,), (tree,), (later,) = (
        Catalog.from_file(folder / f"sample_omm.{suffix}").sets for suffix in ("csv", "xml", "json")
    )
    assert {entry.label for entry in (table, tree, later)} == {"VANGUARD 1 (NORAD 5)"}
    epochs = Epochs(table.epoch_utc, np.linspace(0.0, 86400.0, 97))
    np.testing.assert_array_equal(propagate_sgp4(table, epochs).position_m, propagate_sgp4(tree, epochs).position_m)
    # sgp4's own way in, for an epoch with a fraction: it splits a sum of days that is 0.3 us, 2.5 mm here, coarse
    from sgp4 import omm
    from sgp4.api import Satrec

    for entry in (table, later):
        model = Satrec()
        omm.initialize(model, {**entry.omm(), "OBJECT_ID": entry.object_id})
        theirs = np.array(model.sgp4(model.jdsatepoch, model.jdsatepochF + 0.5)[1]) * 1e3
        position_m, _, _ = propagate_in_teme(entry, Epochs(entry.epoch_utc, np.array([43200.0])))
        validation(
            case=f"OMM of {entry.name}, epoch {entry.epoch_utc.year}, half a day on: position in TEME, worst coordinate",
            source="sgp4 package, omm.initialize",
            expected=0.0,
            got=np.abs(position_m[0] - theirs).max() * 1e3,
            tolerance=3.0,
            unit="mm",
        )
