"""Parts: what a user may write, and the one line that answers what he may not."""

import datetime
import math
import tomllib
from typing import Annotated, Literal, Protocol, runtime_checkable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, ValidationError, model_validator

from rso_lidar.errors import ScenarioError
from rso_lidar.part import (
    Count,
    Direction,
    Flag,
    Fraction,
    Instant,
    Name,
    NotNegative,
    Number,
    Part,
    Positive,
    Quaternion,
    Seam,
    Text,
    Vector,
    Whole,
    explain,
    python_objects,
)

NOON = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


class Ideal(Part):
    """A response without keys of its own."""

    type: Literal["ideal"] = "ideal"


class SecondOrder(Part):
    """A response with keys."""

    type: Literal["second_order"] = "second_order"
    natural_hz: Positive
    damping: NotNegative = 0.7


class Mount(Part):
    """A part without a type."""

    position_m: Vector = (0.0, 0.0, 0.0)
    quaternion_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)


class Wheel(Part):
    """A part that stands in a list."""

    name: Name
    axis: Direction
    speed_deg_s: Number = 0.0


class Machine(Part):
    """A part with all kinds of fields, and parts inside."""

    title: Text = "machine"
    shape: Literal["square", "circle"] = "square"
    start_utc: Instant = NOON
    on: Flag = True
    teeth: Whole = 0
    copies: Count = 1
    share_fraction: Fraction = 0.5
    response: Annotated[Ideal | SecondOrder, Field(discriminator="type")] = Ideal()
    mount: Mount | None = None
    wheel: tuple[Wheel, ...] = ()
    responses: dict[str, Annotated[Ideal | SecondOrder, Field(discriminator="type")]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _teeth_need_wheels(self):
        if self.teeth and not self.wheel:
            raise ValueError("teeth without a wheel: add a [[wheel]]")
        return self


def complaint(text):
    """Return what a file that holds this TOML is answered, as the loader asks for it."""
    raw = tomllib.loads(text)
    with pytest.raises(ValidationError) as caught:
        Machine.model_validate(raw)
    return explain(caught.value, Machine, raw)


def test_a_part_is_what_its_table_fills():
    machine = Machine.model_validate(
        tomllib.loads("""
            title = "m"
            start_utc = 2024-09-17T12:00:00Z
            response = { type = "second_order", natural_hz = 4 }
            mount = { position_m = [0, 0, 0.5] }
            [[wheel]]
            name = "left"
            axis = [0, 0, 1]
        """)
    )
    assert machine == Machine(
        title="m",
        start_utc=NOON,
        response=SecondOrder(natural_hz=4.0),
        mount=Mount(position_m=[0, 0, 0.5]),
        wheel=[Wheel(name="left", axis=(0, 0, 1))],
    )
    assert machine.wheel[0].axis == (0.0, 0.0, 1.0)


def test_a_whole_number_is_a_number():
    """TOML tells 4 from 4.0; a person does not."""
    natural_hz = SecondOrder(natural_hz=4).natural_hz
    assert natural_hz == 4.0
    assert isinstance(natural_hz, float)


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("titel = 'x'", "unknown key 'titel'; did you mean 'title'?"),
        ("[response]\ntype = 'second_order'\nnatural_hz = 4\nnatural_freq_hz = 4", "'natural_hz'?"),
        (
            "[mount]\nposition_mm = [0, 0, 1]",
            "mount: unknown key 'position_mm'; did you mean 'position_m'?",
        ),
        ("[[wheel]]\nname = 'a'\naxis = [0, 0, 1]\nqqq = 1", "unknown key 'qqq'; known keys: name, axis, speed_deg_s"),
        ("[response]\ntype = 'second_order'", "response.natural_hz: is missing; give a value"),
        (
            "[response]\ntype = 'second'",
            "response: unknown type 'second'; did you mean 'second_order'? (known: ideal, second",
        ),
        ("[response]\ndamping = 0.7", "response: needs a table with a 'type', not {'damping': 0.7}"),
        ("response = 'ideal'", "response: needs a table"),
        ("mount = 3", "mount: needs a table, not 3"),
        ("[[wheel]]\nname = 'a'\naxis = [0, 0, 0]", "wheel[0].axis: a direction cannot be the zero vector"),
        (
            "[[wheel]]\nname = 'a'\naxis = [0, 0, 1]\n[[wheel]]\naxis = [0, 0, 1]",
            "wheel[1].name: is missing; give a value",
        ),
        ("[[wheel]]\nname = 'a'\naxis = [0, 'x', 1]", "wheel[0].axis[1]: should be a valid number, not 'x'"),
        ("[[wheel]]\nname = '1st wheel'\naxis = [0, 0, 1]", "wheel[0].name: "),
        ("[mount]\nquaternion_xyzw = [0, 0, 0, 2]", "mount.quaternion_xyzw: needs a unit quaternion x, y, z, w"),
        (
            "start_utc = 2024-09-17T12:00:00",
            "start_utc: a time without an offset is ambiguous; end it with Z or +00:00",
        ),
        (
            "start_utc = '2024-09-17T12:00:00Z'",
            "start_utc: needs a date and time without quotes, such as 2024-09-17T12:00:00Z",
        ),
        ("on = 1", "on: should be a valid boolean, not 1"),
        ("teeth = 4.0", "teeth: should be a valid integer, not 4.0"),
        ("teeth = true", "teeth: should be a valid integer, not True"),
        ("copies = 0", "copies: should be greater than or equal to 1, not 0"),
        ("share_fraction = 1.5", "share_fraction: should be less than or equal to 1, not 1.5"),
        ("share_fraction = nan", "share_fraction: should be a finite number, not nan"),
        ("share_fraction = '0.5'", "share_fraction: should be a valid number, not '0.5'"),
        ("title = ''", "title: "),
        ("shape = 'circl'", "shape: unknown value 'circl'; did you mean 'circle'? (known: square, circle)"),
        ("[wheel]\nname = 'a'", "wheel: needs a list ([[...]] for a list of tables), not {'name': 'a'}"),
        ("[[wheel]]\nnam = 'a'", "wheel[0]: unknown key 'nam'; did you mean 'name'?; wheel[0].axis: is missing"),
        ("title = 3", "title: should be a valid string, not 3"),
        ("teeth = 4", "teeth without a wheel: add a [[wheel]]"),
        (
            "[responses.a]\ntype = 'second_order'\nnatural_hz = -1",
            "responses.a.natural_hz: should be greater than 0, not -1",
        ),
        ("on = 1\nteeth = 'x'", "on: should be a valid boolean, not 1; teeth: should be a valid integer, not 'x'"),
    ],
)
def test_bad_input_is_answered_in_one_line(text, answer):
    said = complaint(text)
    assert answer in said
    assert "\n" not in said
    assert "pydantic" not in said


def test_the_place_leaves_out_the_branch_of_a_union():
    text = "[response]\ntype = 'second_order'\nnatural_hz = 'x'"
    assert complaint(text) == "response.natural_hz: should be a valid number, not 'x'"


def test_a_misspelt_key_is_told_without_the_key_that_it_leaves_missing():
    said = complaint("[[wheel]]\nnam = 'a'\naxis = [0, 0, 1]")
    assert said == "wheel[0]: unknown key 'nam'; did you mean 'name'?"


def test_as_many_problems_are_listed_as_fit_and_the_others_counted():
    said = complaint("\n".join(f"key_{number:02} = 1" for number in range(50)))
    listed = said.count("unknown key")
    assert said.endswith(f" (and {50 - listed} more)")
    assert 700 < len(said) < 830
    assert said.count("known keys: ") == 1
    assert complaint("\n".join(f"copie{number} = 1" for number in range(3))).count("did you mean 'copies'?") == 3


def test_long_values_are_cut_short():
    said = complaint(f"on = '{'x' * 500}'")
    assert said.endswith("...")
    assert len(said) < 120


def test_python_gets_the_same_answer_with_the_name_of_the_part():
    with pytest.raises(ScenarioError) as caught:
        SecondOrder(natural_hz=4.0, dampng=1.0)
    assert str(caught.value) == "SecondOrder: unknown key 'dampng'; did you mean 'damping'?"
    assert caught.value.__suppress_context__


def test_python_answers_for_parts_inside():
    with pytest.raises(ScenarioError, match=r"^Machine: wheel\[0\]\.axis: a direction cannot be the zero vector$"):
        Machine(wheel=[{"name": "a", "axis": (0, 0, 0)}])


@pytest.mark.parametrize("value", ["4", True, None, math.nan, math.inf, -math.inf, [4], 0, -1.0])
def test_what_is_no_positive_number(value):
    with pytest.raises(ScenarioError, match="natural_hz"):
        SecondOrder(natural_hz=value)


@pytest.mark.parametrize("value", [(0, 1), (0, 0, 1, 0), (0, 0, math.nan), (True, 0, 0), "xyz"])
def test_what_is_no_vector(value):
    with pytest.raises(ScenarioError, match="position_m"):
        Mount(position_m=value)


def test_a_naive_datetime_is_refused_and_an_offset_kept():
    with pytest.raises(ScenarioError, match=r"start_utc: a time without an offset is ambiguous"):
        Machine(start_utc=datetime.datetime(2024, 9, 17, 12))
    paris = datetime.timezone(datetime.timedelta(hours=2))
    assert Machine(start_utc=datetime.datetime(2024, 9, 17, 14, tzinfo=paris)).start_utc == NOON


def test_a_part_is_frozen():
    mount = Mount()
    with pytest.raises(ValidationError, match="frozen"):
        mount.position_m = (1.0, 0.0, 0.0)


def test_parts_can_be_keys():
    assert len({SecondOrder(natural_hz=4.0), SecondOrder(natural_hz=4), SecondOrder(natural_hz=5.0)}) == 2


def test_replace_changes_a_copy():
    slow = SecondOrder(natural_hz=4.0)
    fast = slow.replace(natural_hz=8)
    assert (slow.natural_hz, fast.natural_hz, fast.damping) == (4.0, 8.0, 0.7)
    assert type(fast) is SecondOrder


def test_replace_validates_values_keys_and_the_whole():
    wheels = Machine(teeth=3, wheel=[Wheel(name="a", axis=(0, 0, 1))])
    with pytest.raises(ScenarioError, match=r"^SecondOrder: natural_hz: should be greater than 0, not -1\.0$"):
        SecondOrder(natural_hz=4.0).replace(natural_hz=-1.0)
    with pytest.raises(ScenarioError, match=r"unknown key 'natural'; did you mean 'natural_hz'\?"):
        SecondOrder(natural_hz=4.0).replace(natural=4.0)
    with pytest.raises(ScenarioError, match="teeth without a wheel"):
        wheels.replace(wheel=())


def test_replace_keeps_what_was_left_to_the_default():
    """A scenario written out again holds what its author wrote, and no more."""
    assert SecondOrder(natural_hz=4.0).replace(natural_hz=5.0).model_fields_set == {"natural_hz"}


@given(
    natural_hz=st.floats(min_value=1e-6, max_value=1e6),
    position_m=st.tuples(*[st.floats(-1e9, 1e9)] * 3),
    start_utc=st.datetimes(
        datetime.datetime(1900, 1, 1),
        datetime.datetime(2200, 1, 1),
        timezones=st.just(datetime.UTC),
    ),
)
def test_a_part_survives_its_own_table(natural_hz, position_m, start_utc):
    machine = Machine(
        start_utc=start_utc, response=SecondOrder(natural_hz=natural_hz), mount=Mount(position_m=position_m)
    )
    assert Machine.model_validate(machine.model_dump()) == machine
    assert machine.replace() == machine


# ------------------------------------------------------------------------------------------------------------- seams


@runtime_checkable
class Noisy(Protocol):
    """What a voice in `Machine`'s place answers."""

    def loudness(self) -> float: ...


class Hum(Part):
    type: Literal["hum"] = "hum"
    level: Number = 1.0


class Click(Part):
    type: Literal["click"] = "click"


class Whistle:
    def loudness(self):
        return 3.0


class Chord(Part):
    tones: Whole = 3

    def loudness(self):
        return 4.0


DescribedVoice = Annotated[Hum | Click, Field(discriminator="type")]
Voice = Annotated[DescribedVoice | Noisy, Seam(DescribedVoice, Noisy)]


class Choir(Part):
    lead: Voice | None = None
    others: dict[str, Voice] = Field(default_factory=dict)
    row: tuple[Voice, ...] = ()


def test_a_seam_takes_tables_parts_and_objects():
    whistle = Whistle()
    choir = Choir(lead=whistle, others={"a": {"type": "hum"}, "b": Chord()}, row=(Click(), whistle))
    assert choir.lead is whistle
    assert choir.others == {"a": Hum(), "b": Chord()}
    assert choir.row == (Click(), whistle)
    assert python_objects(choir) == [whistle, Chord(), whistle]
    assert python_objects(choir.replace(lead=Hum(), others={}, row=())) == []


def test_a_dump_names_the_objects_and_cannot_be_read_again():
    dump = Choir(lead=Whistle(), row=(Chord(tones=4), Hum())).model_dump(exclude_none=True)
    assert dump["lead"] == {"type": "python", "object": f"{__name__}.Whistle(...)"}
    assert dump["row"] == ({"type": "python", "object": f"{__name__}.Chord(tones=4)"}, {"type": "hum", "level": 1.0})
    with pytest.raises(ScenarioError, match=r"Choir: lead: represents the Python object .*Whistle.*; set it again"):
        Choir(**dump)


@pytest.mark.parametrize(
    ("voice", "message"),
    [
        (Whistle, r"lead: is the class Whistle; give an instance, such as Whistle\(\)"),
        (object(), r"lead: needs a table with a 'type', a part, or an object with loudness \(the protocol Noisy\)"),
        ({"type": "hun"}, r"lead: unknown type 'hun'; did you mean 'hum'"),
        (5, "lead: needs a table"),
        (Choir(), "lead: needs a table with a 'type', a part, or an object with loudness"),
    ],
)
def test_what_fits_no_seam_is_told(voice, message):
    with pytest.raises(ScenarioError, match=message):
        Choir(lead=voice)


def test_a_seam_leaves_the_schema_closed():
    schema = Choir.model_json_schema()
    assert set(schema["$defs"]) == {"Hum", "Click"}
    assert "python" not in str(schema)
