"""Whatever is given to the constructors and functions of `rl`, what is refused is one line of ours."""

import datetime
import importlib
import inspect
import pkgutil
import tomllib

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RsoLidarError
from rso_lidar.part import Part
from rso_lidar.records import Record

# What a TOML file or --set can hold: numbers that no machine's integer or float holds, and shapes that fit nothing.
WRITTEN = [
    "18446744073709551616", "-9223372036854775809", "9" * 400, "1e308", "-inf", "nan", "true", "[]", "{}", '"x"',
    "[18446744073709551616, 1, 1]", "[[9223372036854775808, 1, 1], [1, 1, 1], [1, 1, 1]]", "[1e300, 1e300, 1e300]",
    "[[[[1]]]]", "[[1, 2], [3]]", "[true]", "[0, 0, 0]", "2024-01-01", "0001-01-01T00:00:00Z",
]  # fmt: skip
VALUES = [tomllib.loads(f"x = {text}")["x"] for text in WRITTEN]
OBJECTS = [None, object(), b"x", np.datetime64("2024-01-01"), np.array([[1, 2], [3, 4]]), np.array(["a"]), 10**5000]


for _module in pkgutil.walk_packages(rl.__path__, "rso_lidar."):  # rooms load their parts on first use
    if not _module.name.endswith("__main__"):
        importlib.import_module(_module.name)


def below(base):
    return {base}.union(*map(below, base.__subclasses__()))


PARTS = sorted(
    (part for part in below(Part) if part.__module__.startswith("rso_lidar.") and not inspect.isabstract(part)),
    key=lambda part: part.__qualname__,
)


@pytest.mark.filterwarnings("ignore::rso_lidar.errors.RsoLidarWarning")
def test_a_field_of_a_part_takes_any_value_or_says_why_not():
    assert len(PARTS) > 80
    for part in PARTS:
        for field in part.model_fields:
            for value in [*VALUES, *OBJECTS]:
                said = ""
                try:
                    part(**{field: value})
                except RsoLidarError as error:
                    said = str(error)
                except Exception as error:
                    pytest.fail(f"{part.__name__}.{field} = {type(value)}: {type(error).__name__}: {error!s:.200}")
                assert "\n" not in said


def test_an_inertia_beyond_every_integer_is_one_line(text):
    tumble = 'target.0.attitude={type="tumble", body_rate_deg_s=[0, 0, 1], inertia_kg_m2=[18446744073709551616, 1, 1]}'
    with pytest.raises(rl.ScenarioError, match="inertia_kg_m2: needs numbers up to 1e\\+12; check them and their unit"):
        rl.Scenario.loads(text, settings=(tumble,))


@pytest.mark.parametrize(
    "value", ["2024-01-01T00:00:00Z", np.datetime64("2024-01-01"), None, 1.0, datetime.date(2024, 1, 1)]
)
def test_what_is_no_datetime_is_no_epoch(value):
    with pytest.raises(rl.ScenarioError, match="start_utc: needs a datetime with an offset"):
        rl.orbit.Epochs(value, [0.0])
    epochs = rl.orbit.Epochs(datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC), [0.0])
    with pytest.raises(rl.ScenarioError, match="since: needs a datetime with an offset"):
        epochs.since(value)


@pytest.mark.parametrize(
    "times", ["x", [object()], [[1, 2], [3]], None, np.array(["2024-01-01"], dtype="M8[s]"), [10**400], {}]
)
def test_what_is_no_seconds_is_no_epochs(times):
    with pytest.raises(rl.ScenarioError, match="time_s: needs"):
        rl.orbit.Epochs(datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC), times)


def test_a_record_takes_arrays_that_fit_or_says_why_not():
    classes = [value for name in rl.records.__all__ if inspect.isclass(value := getattr(rl.records, name))]
    records = [record for record in classes if issubclass(record, Record) and record is not Record]
    assert len(records) > 8
    for record in records:
        asked = [p.name for p in inspect.signature(record).parameters.values() if p.default is p.empty]
        for value in (
            "x",
            1.0,
            float("nan"),
            object(),
            np.datetime64("2024-01-01"),
            {},
            [[1, 2], [3]],
            np.array(["a"]),
        ):
            with pytest.raises(RsoLidarError) as refused:
                record(**dict.fromkeys(asked, value))
            assert str(refused.value).startswith(f"{record.__name__}.")


@pytest.mark.parametrize("value", [None, 1, 2.5, object(), [], {}])
def test_what_is_no_path_or_no_scenario(value):
    for call in (rl.open, lambda path: rl.save(path, []), rl.Scenario.load, rl.Scenario.loads, rl.study.Study.load):
        with pytest.raises(RsoLidarError):
            call(value)
    for call in (rl.timeline, lambda one: next(rl.simulate(one)), lambda one: rl.flash(one, None, None)):
        with pytest.raises(rl.ScenarioError, match="needs a Scenario"):
            call(value)
