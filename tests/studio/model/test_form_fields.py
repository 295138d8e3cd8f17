"""Fields of forms: every field of every part has what a form needs, and values come back as they were typed."""

import datetime

import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.part import parse_toml
from rso_lidar.scenario import Scenario, find_examples
from rso_lidar.studio.model.form_fields import (
    SCALARS,
    TABLES,
    find_field,
    find_part,
    list_fields,
    parse_value,
    show_value,
)

EXAMPLES = find_examples()


def iterate_parts(cls):
    """Yield a part and all parts that can stand inside it, each once."""
    seen = {}
    waiting = [cls]
    while waiting:
        part = waiting.pop()
        if part not in seen:
            seen[part] = None
            yield part
            waiting += [inner for field in list_fields(part) for inner in field.classes]


def list_all():
    return [(cls, field) for cls in iterate_parts(Scenario) for field in list_fields(cls)]


def walk(tables, steps=()):
    """Yield the steps and the value of all that a text holds."""
    for key, value in tables.items() if isinstance(tables, dict) else enumerate(tables):
        yield (*steps, key), value
        if isinstance(value, dict | list):
            yield from walk(value, (*steps, key))


def test_every_part_of_a_scenario_is_found_once():
    found = list(iterate_parts(Scenario))
    assert found[0] is Scenario
    assert len(found) == len(set(found)) > 60
    assert {"Target", "Laser", "Tle", "PanTilt", "Gyro"} & {cls.__name__ for cls in found} >= {"Target", "Laser", "Tle"}


def test_every_field_has_a_kind_that_a_form_can_draw():
    assert [f"{cls.__name__}.{field.key}" for cls, field in list_all() if field.kind not in SCALARS + TABLES] == []
    assert {field.kind for _, field in list_all()} == {*SCALARS, *TABLES}


def test_every_field_says_its_meaning():
    assert [f"{cls.__name__}.{field.key}" for cls, field in list_all() if len(field.meaning) < 5] == []
    assert [f"{cls.__name__}.{field.key}" for cls, field in list_all() if "`" in field.meaning + field.bounds] == []


def test_every_choice_has_choices_and_every_table_the_parts_that_fill_it():
    wrong = [
        f"{cls.__name__}.{field.key}"
        for cls, field in list_all()
        if (field.kind in ("choice", "variant", "entries")) != bool(field.choices)
        or (field.kind in TABLES) != bool(field.classes)
        or (field.kind == "table" and len(field.classes) != 1)
        or (field.kind == "variant" and len(field.choices) != len(field.classes))
    ]
    assert wrong == []


def test_every_type_that_a_form_offers_chooses_its_part_and_says_what_it_is():
    wrong = [
        f"{cls.__name__}.{field.key}: {tag}"
        for cls, field in list_all()
        if field.kind == "variant"
        for tag, part in zip(field.choices, field.classes, strict=True)
        if field.choose({"type": tag}) is not part or not field.choices[tag]
    ]
    assert wrong == []


def test_defaults_are_shown_as_they_are_typed():
    wrong = []
    for cls, field in list_all():
        if field.kind in SCALARS and field.default:
            default = cls.model_fields[field.key].get_default(call_default_factory=True)
            typed = parse_value(field.kind, field.default)
            if typed != (list(default) if isinstance(default, tuple) else default):
                wrong.append(f"{cls.__name__}.{field.key}: {default!r} is shown as {field.default}")
    assert wrong == []


def test_units_stand_apart_from_meanings():
    fields = {field.key: field for field in list_fields(find_part(Scenario, {}, ("lidar", "laser")))}
    assert fields["energy_mj"].unit == "mJ"
    assert "mJ" not in fields["energy_mj"].meaning
    assert fields["energy_mj"].bounds


@pytest.mark.parametrize("name", EXAMPLES)
def test_values_of_examples_come_back_as_they_were(name):
    tables = parse_toml(EXAMPLES[name].text, name, ScenarioError)
    count = 0
    for steps, value in walk(tables):
        cls = find_part(Scenario, tables, steps[:-1]) if steps[1:] else Scenario
        field = next((one for one in list_fields(cls) if one.key == steps[-1]), None) if cls else None
        if field and field.kind in SCALARS:
            typed = show_value(value)
            assert parse_value(field.kind, typed.lower() if isinstance(value, bool) else typed) == value, steps
            count += 1
    assert count > 10


@pytest.mark.parametrize("name", EXAMPLES)
def test_places_of_examples_have_the_part_that_the_scenario_has(name):
    tables = parse_toml(EXAMPLES[name].text, name, ScenarioError)
    scenario = Scenario.load(EXAMPLES[name].path)
    wrong, count = [], 0
    for steps, value in walk(tables):
        if isinstance(value, dict):
            here = scenario
            for step in steps:
                here = here[step] if isinstance(step, int) or isinstance(here, dict) else getattr(here, step)
            if not isinstance(here, dict):  # a mapping of a user's own names is a value
                count += 1
                found = find_part(Scenario, tables, steps)
                if found is not type(here):
                    wrong.append(f"{steps}: {found}, not {type(here).__name__}")
    assert wrong == []
    assert count > 3


def test_a_field_is_found_by_the_place_of_its_table():
    tables = {"target": [{"motion": {"type": "no_such"}}], "lidar": {"laser": {}}}
    for steps, key in ((("target", 0), "target"), (("lidar", "laser"), "laser"), (("target", 0, "motion"), "motion")):
        assert find_field(Scenario, tables, steps).key == key
    for steps in ((), ("no_such",), ("target", 0, "motion", "deeper"), (0,)):
        assert find_field(Scenario, tables, steps) is None


def test_no_part_at_places_that_a_text_has_not():
    tables = {"target": [{"motion": {"type": "no_such"}}], "lidar": 7, "time": []}
    for steps in (
        ("no_such",),
        ("target", 0, "motion"),
        ("target", 0, "no_such", "deeper"),
        ("lidar", "laser", "x", 1),
    ):
        assert find_part(Scenario, tables, steps) is None
    assert find_part(Scenario, tables, ("target", 9)).__name__ == "Target"


@pytest.mark.parametrize(
    ("kind", "typed", "value"),
    [
        ("number", "12.5", 12.5),
        ("number", " -1e-7 ", -1e-7),
        ("number", "3", 3),
        ("number", "1_000", 1000),
        ("number", "0.1", 0.1),
        ("number", "123456.789012345", 123456.789012345),
        ("whole", "20240917", 20240917),
        ("flag", "true", True),
        ("flag", "false", False),
        ("text", "a \"quoted\" 'name' \\ ü", "a \"quoted\" 'name' \\ ü"),
        ("text", "true", "true"),
        ("choice", "sun", "sun"),
        ("instant", "2024-09-17T12:00:00Z", datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)),
        ("value", "[0, -3000, 0.5]", [0, -3000, 0.5]),
        ("value", "[[1, 2], [3, 4]]", [[1, 2], [3, 4]]),
        ("value", '["a \\"b\\" \\\\", "c"]', ['a "b" \\', "c"]),
        ("value", '{ a = 1, b = "x", c = [true] }', {"a": 1, "b": "x", "c": [True]}),
    ],
)
def test_values_are_typed_as_in_toml_and_shown_as_typed(kind, typed, value):
    read = parse_value(kind, typed)
    assert read == value
    assert type(read) is type(value)
    again = parse_value(kind, show_value(read))
    assert again == value


def test_odd_keys_and_texts_within_a_value_come_back():
    for value in ({"a b": 1, "ü": 2, 'q"': 3}, ["a\nb", "\t", "\x7f", "\\"], [{"x y": [1.5]}], [True, False]):
        assert parse_value("value", show_value(value)) == value


@pytest.mark.parametrize(
    ("kind", "typed"),
    [
        ("number", "twelve"),
        ("number", "12,5"),
        ("number", "true"),
        ("number", '"12"'),
        ("number", "1\nb = 2"),
        ("number", "[1]"),
        ("whole", "12.5"),
        ("whole", "false"),
        ("whole", "1 2"),
        ("instant", "2024-09-17"),
        ("instant", "12:00:00"),
        ("instant", "noon"),
        ("value", "[0, 0"),
        ("value", "{ a = }"),
        ("value", "1\ny = 2"),
        ("value", "[" * 5000),
        ("value", "plain words"),
    ],
)
def test_bad_input_is_refused_in_one_line_that_says_what_to_type(kind, typed):
    with pytest.raises(ScenarioError, match=r"is not (a|TOML)") as caught:
        parse_value(kind, typed)
    assert len(str(caught.value)) < 120
    assert "such as" in str(caught.value) or "whole number" in str(caught.value)
