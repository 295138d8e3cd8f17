"""The shape of rooms and modules: short, one sub-room deep, well named, and no random numbers out of nowhere."""

import ast
import io
import tokenize
from pathlib import Path

import pytest

from rso_lidar.cli.app import COMMANDS
from tests.house.sources import parse

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rso_lidar"
MODULES = sorted(PACKAGE.rglob("*.py"))
ROOMS = sorted({file.parent for file in MODULES})
FOLDERS = ("rso_lidar", "models", "tests", "examples", "benchmarks")
NO_ROOM = {"utils", "util", "helpers", "common", "core", "base", "manager", "misc"}
MOST_MODULES = 14  # on one level of a room
LISTS = {"cli"}  # a flat list of like things: one file for each command
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
MOST_OF_STUDIO = 2000  # lines of code over the public API
LONGEST = 400  # lines; past it a module is two
SHORTEST = 8  # lines; what is shorter belongs into the module that uses it

# What numpy.random offers that keeps no state of its own.
STATELESS = {"Generator", "default_rng", "SeedSequence", "BitGenerator", "PCG64", "PCG64DXSM", "Philox", "SFC64"}


def relative(file):
    return file.relative_to(ROOT).as_posix()


def test_there_is_a_package_to_look_at():
    assert PACKAGE / "units.py" in MODULES and "rso_lidar/units.py" in parse(*FOLDERS)


def test_modules_are_short():
    lines = {relative(module): len(module.read_text(encoding="utf-8").splitlines()) for module in MODULES}
    long = {name: count for name, count in lines.items() if count > LONGEST}
    assert not long, f"past {LONGEST} lines a module is two"


def count_code(source):
    """Return the number of lines of a source that hold code: no empty line, comment or docstring."""
    layout = {tokenize.NL, tokenize.NEWLINE, tokenize.COMMENT, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    tokens = [one for one in tokenize.generate_tokens(io.StringIO(source).readline) if one.type not in layout]
    code = {line for one in tokens for line in range(one.start[0], one.end[0] + 1)}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node) is not None:
            code -= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return len(code)


def test_lines_of_code_are_counted():
    assert count_code('"""A.\n\nB.\n"""\n\n# c\nx = [\n    1,\n]\n\n\ndef f():\n    """F."""\n    return x\n') == 5


def test_the_studio_stays_small():
    sources = [file.read_text(encoding="utf-8") for file in (PACKAGE / "studio").rglob("*.py")]
    assert 1000 < sum(map(count_code, sources)) <= MOST_OF_STUDIO, "what others can use belongs below the studio"


def test_modules_are_worth_a_file():
    lines = {file: len(file.read_text(encoding="utf-8").splitlines()) for file in MODULES if "__" not in file.stem}
    assert len(lines) > 300
    assert not {relative(file): count for file, count in lines.items() if count < SHORTEST}


def test_modules_say_what_is_in_them():
    silent = [name for name, tree in parse("rso_lidar").items() if not ast.get_docstring(tree)]
    assert not silent


def test_every_module_and_room_is_named_after_what_lives_there():
    names = {word for file in PACKAGE.rglob("*.py") for word in file.relative_to(PACKAGE).with_suffix("").parts}
    assert not names & NO_ROOM


def test_sub_rooms_are_one_level_deep():
    nested = [relative(file) for file in MODULES if len(file.relative_to(PACKAGE).parts) > 3]
    assert not nested, "a room may hold sub-rooms; a sub-room holds modules only"


def test_a_room_holds_no_more_than_one_can_keep_in_mind():
    """A dozen or so modules and sub-rooms on each level; what is more is divided."""
    levels = {room: {file for file in room.iterdir() if file.suffix == ".py" or file.is_dir()} for room in ROOMS}
    sizes = {
        relative(room): len([file for file in found if file.name not in ("__init__.py", "__pycache__")])
        for room, found in levels.items()
        if room.relative_to(PACKAGE).as_posix() not in (".", *LISTS)
    }
    assert len(sizes) > 8
    assert not {room: size for room, size in sizes.items() if size > MOST_MODULES}


def test_every_room_has_a_door():
    assert all((room / "__init__.py").is_file() for room in ROOMS)


def inner_imports(room):
    """Return by module of a room without sub-rooms the modules of it that it imports, within functions too."""
    modules = {Path(name).stem: tree for name, tree in parse(f"rso_lidar/{room}").items()}
    found = {}
    for name, tree in modules.items():
        asked = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
        door = f"rso_lidar.{room}"
        named = {alias.name for node in asked if node.module == door for alias in node.names}
        named |= {node.module.removeprefix(f"{door}.") for node in asked if node.module.startswith(f"{door}.")}
        found[name] = named & set(modules) - {"__init__"}
    return found


def test_commands_do_not_import_one_another():
    imported = inner_imports("cli")
    commands = set(COMMANDS)
    doors = {name: of & commands for name, of in imported.items() if name != "__init__"}
    assert len(commands) > 10 and not {name: of for name, of in doors.items() if of}, "what is shared is a module"


def dotted(node):
    """Return the words of an attribute chain such as ``np.random.rand``, or nothing."""
    words = []
    while isinstance(node, ast.Attribute):
        words.append(node.attr)
        node = node.value
    return [*([node.id] if isinstance(node, ast.Name) else []), *words[::-1]]


def random_sins(tree):
    """Return what in a parsed source draws random numbers that no seed governs."""
    sins = []
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                sins += [alias.name for alias in names if alias.name in ("random", "numpy.random")]
            case ast.ImportFrom(module="random"):
                sins.append("from random")
            case ast.ImportFrom(module="numpy.random", names=names):
                sins += [alias.name for alias in names if alias.name not in STATELESS]
            case ast.Attribute():
                words = dotted(node)
                if words[:2] in (["np", "random"], ["numpy", "random"]) and set(words[2:3]) - STATELESS:
                    sins.append(".".join(words))
            case ast.Call(func=func, args=args, keywords=keywords):
                name = (dotted(func) or [""])[-1]
                given = {keyword.arg for keyword in keywords}
                if name in ("default_rng", "SeedSequence") and not args and not given:
                    sins.append(f"{name}() without a seed")
                if name == "rvs" and not given & {"random_state", "rng"}:
                    sins.append("rvs() without a generator")
                if (
                    dotted(func)[-2:] == ["Rotation", "random"]
                    and len(args) < 2
                    and not given & {"random_state", "rng"}
                ):
                    sins.append("Rotation.random() without a generator")
    return sins


def test_no_random_number_without_a_generator():
    sins = {name: random_sins(tree) for name, tree in parse(*FOLDERS).items()}
    assert not {name: of for name, of in sins.items() if of}


@pytest.mark.parametrize(
    "sin",
    [
        "import random",
        "from random import gauss",
        "from numpy.random import rand",
        "import numpy as np\nnp.random.seed(1)",
        "import numpy\nx = numpy.random.normal(size=3)",
        "import numpy as np\nrng = np.random.default_rng()",
        "from scipy.stats import norm\nnorm.rvs(3)",
        "from scipy.spatial.transform import Rotation\nRotation.random(5)",
    ],
)
def test_a_sin_is_seen(sin):
    assert random_sins(ast.parse(sin))


@pytest.mark.parametrize(
    "honest",
    [
        "import numpy as np\nrng = np.random.default_rng(7)\nrng.normal()",
        "import numpy as np\ndef f(rng: np.random.Generator): return rng.random()",
        "from scipy.spatial.transform import Rotation\nRotation.random(5, rng=rng)",
    ],
)
def test_a_generator_handed_on_is_no_sin(honest):
    assert random_sins(ast.parse(honest)) == []
