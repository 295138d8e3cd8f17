"""TOML that would take gigabytes is refused; whatever a person or a recording writes is not."""

import tomllib

import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.part import DEEPEST_TOML, MOST_TOML_BYTES, parse_toml
from rso_lidar.part.toml_text import MOST_KEYS

SOUND = [
    'a.b."c.d".e = 1\n[x.y]\nz = [[1, 2], { p = "q" }]',
    "text = \"a.b.c = [[[[ {{{{ ]\"\nmore = '''[[\n[['''",
    "# [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[ a.b.c\nx = 1 # {{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{",
    'lines = """\n1 23456U 98067A   24001.5  .00016717  00000-0  10270-3 0  9000\n"""',
    "numbers = [" + ", ".join(["1.5"] * 200_000) + "]",
    "deep = " + "[" * (DEEPEST_TOML - 1) + "]" * (DEEPEST_TOML - 1),
]


@pytest.mark.parametrize("text", SOUND, ids=range(len(SOUND)))
def test_sound_texts_are_parsed(text):
    assert parse_toml(text, "x.toml", ScenarioError) == tomllib.loads(text)


BOMBS = {
    "one key of many steps": ("a" + ".a" * 50_000 + " = 1", "levels deep"),
    "quoted steps": ("a" + '."a"' * 50_000 + " = 1", "levels deep"),
    "blanks about the dots": ("a" + " . a" * 50_000 + " = 1", "levels deep"),
    "a header of many steps": ("[a" + ".a" * 50_000 + "]", "levels deep"),
    "lists in lists": ("a = " + "[" * 50_000, "levels deep"),
    "tables in tables": ("a = " + "{a = " * 50_000, "levels deep"),
    "many keys": ("".join(f"k{i} = 1\n" for i in range(MOST_KEYS + 1)), "keys; move large tables"),
    "many deep keys": ("".join(f"k{i}.{'a.' * 20}a = 1\n" for i in range(MOST_KEYS // 20)), "keys; move large tables"),
    "long": ("# " + "x" * MOST_TOML_BYTES, "million characters"),
    "quotes without end": ('a = "' * 100_000, "not valid TOML"),
    "long quotes without end": ('a = """' * 99_999, "TOML"),
    "a number of many digits": ("a = 1" + "0" * 5000, "not readable as TOML"),
    "no text": (b"a = 1", "not a str"),
    "nothing": (None, "not a str"),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_what_no_person_writes_is_one_line(bomb):
    text, words = BOMBS[bomb]
    with pytest.raises(ScenarioError) as refused:
        parse_toml(text, "x.toml", ScenarioError)
    line = str(refused.value)
    assert line.startswith("x.toml: ") and words in line and "\n" not in line and len(line) < 200


def test_a_very_long_word_is_refused_at_once():  # it took minutes, which `limits` forbids
    with pytest.raises(ScenarioError, match="not readable as TOML"):
        parse_toml(f"x = 1{'0' * 300_000}\n", "a.toml", ScenarioError)
