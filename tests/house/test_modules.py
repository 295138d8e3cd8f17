"""The shape of rooms and modules: used at home, short, one sub-room deep, well named, no random numbers out of nowhere."""

import ast
from pathlib import Path

import pytest

from rso_lidar.cli.app import COMMANDS
from tests.house.sources import parse, walk

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rso_lidar"
MODULES = sorted(PACKAGE.rglob("*.py"))
ROOMS = sorted({file.parent for file in MODULES})
FOLDERS = ("rso_lidar", "models", "tests", "examples", "benchmarks")
NO_ROOM = {"utils", "util", "helpers", "common", "core", "base", "manager", "misc"}
LONGEST = 500  # lines; past it a module is two
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


def test_every_room_has_a_door():
    assert all((room / "__init__.py").is_file() for room in ROOMS)


def dotted_name(file):
    """Return the name under which a file of the package is imported."""
    words = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(words[:-1] if words[-1] == "__init__" else words)


def is_main(node):
    """Return whether a statement is what a module does that is run by ``python -m``."""
    return isinstance(node, ast.If) and ast.unparse(node.test) == "__name__ == '__main__'"


def find_homeless(trees):
    """Return the modules that no module of their own room imports, its door included; sources by dotted name.

    A format that a registry names in a text is used there. A module that is run by ``python -m`` needs no user.
    """
    users = {name: set() for name in trees}
    for name, tree in trees.items():
        for node in walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                full = {f"{node.module}.{alias.name}" for alias in node.names}
                for module in (full & set(trees)) or {node.module} & set(trees):
                    users[module].add(name)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and ":" in node.value:
                room = ".".join(name.split(".")[:2])
                users.get(f"{room}.{node.value.split(':')[0]}", set()).add(name)
    inside = [name for name in trees if name.count(".") >= 2 and not any(it.startswith(f"{name}.") for it in trees)]
    run = {name for name, tree in trees.items() if any(is_main(node) for node in tree.body)}
    alone = [name for name in inside if not any(it.split(".")[1] == name.split(".")[1] for it in users[name])]
    return [name for name in alone if name not in run]


def test_modules_are_used_in_their_own_room():
    """Commands are imported by name, when they are called."""
    trees = {dotted_name(ROOT / name): tree for name, tree in parse("rso_lidar").items()}
    homeless = [name for name in find_homeless(trees) if not name.startswith("rso_lidar.cli.")]
    assert not homeless, "move it to the room that uses it, or export what others need at the room's door"


def test_a_module_without_a_user_at_home_is_seen():
    sources = {
        "p.a": "from p.a.x import f",
        "p.a.x": "",
        "p.a.y": "",
        "p.a.z": "F = 'w:write'",
        "p.a.w": "from p.a import z",
        "p.b.v": "from p.a.y import g",
    }
    assert find_homeless({name: ast.parse(source) for name, source in sources.items()}) == ["p.a.y", "p.b.v"]


def inner_imports(room):
    """Return by module of a room without sub-rooms the modules of it that it imports, within functions too."""
    modules = {Path(name).stem: tree for name, tree in parse(f"rso_lidar/{room}").items()}
    found = {}
    for name, tree in modules.items():
        asked = [node for node in walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
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
    for node in walk(tree):
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
