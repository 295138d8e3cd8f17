"""One word for one thing: names that differ, and no question about the kind of a part outside the room that owns it."""

import ast
import re
import subprocess
from itertools import combinations
from pathlib import Path
from typing import get_args

import pytest

import rso_lidar as rl
from rso_lidar.part import Part
from tests.house.sources import parse, walk

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rso_lidar"


def classes(trees):
    """Return, by name without leading underscores, the modules that define a class."""
    found = {}
    for module, tree in trees.items():
        for node in walk(tree):
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name.lstrip("_"), []).append(module)
    return found


def test_a_class_name_occurs_once():
    found = classes(parse("rso_lidar"))
    assert len(found) > 300
    assert not {name: modules for name, modules in found.items() if len(modules) > 1}


def alike(one, other):
    """Return whether one letter more, less or changed turns one name into the other."""
    if abs(len(one) - len(other)) > 1:
        return False
    short, long = sorted((one, other), key=len)
    if len(short) == len(long):
        return sum(a != b for a, b in zip(one, other, strict=True)) == 1
    return any(long[:k] + long[k + 1 :] == short for k in range(len(long)))


def test_no_two_modules_of_a_room_differ_by_one_letter():
    """Nor two rooms, nor two sub-rooms of a room; a module may share the word of the sub-room that it is in."""
    places = {}
    for module in parse("rso_lidar"):
        room, *inner = Path(module).with_suffix("").parts[1:]
        places.setdefault("rooms", set()).add(room)
        if inner:
            places.setdefault(room, set()).add(inner[-1])
        if len(inner) > 1:
            places.setdefault(f"{room}: sub-rooms", set()).add(inner[0])
    pairs = {
        place: [pair for pair in combinations(sorted(names), 2) if alike(*pair)] for place, names in places.items()
    }
    assert not {place: found for place, found in pairs.items() if found}


def modules_of(trees):
    """Return the places of all modules that are no doors, by room."""
    found = {}
    for module in trees:
        room, *inner = Path(module).with_suffix("").parts[1:]
        if inner and inner[-1] != "__init__":
            found.setdefault(room, []).append(inner)
    return found


def test_no_two_modules_of_a_room_share_a_name():
    """Nor a module and a sub-room; the module that gives a sub-room its name may live in it."""
    found = modules_of(parse("rso_lidar"))
    assert len(found) > 12
    shared = {}
    for room, places in found.items():
        names = [inner[-1] for inner in places]
        folders = {inner[0] for inner in places if len(inner) > 1}
        twice = {name for name in names if names.count(name) > 1}
        twice |= {inner[-1] for inner in places if inner[-1] in folders and inner[0] != inner[-1]}
        if twice:
            shared[room] = sorted(twice)
    assert not shared


def plurals(name):
    """Return what a plural of a word can look like."""
    return {f"{name}s", f"{name}es", f"{name.removesuffix('y')}ies"}


def test_no_two_modules_are_singular_and_plural_of_a_word():
    """In the whole package but for the command line, whose modules have the names that a user types."""
    names = {inner[-1] for room, found in modules_of(parse("rso_lidar")).items() if room != "cli" for inner in found}
    names |= {Path(module).stem for module in parse("rso_lidar") if len(Path(module).parts) == 2}
    assert len(names) > 300
    assert not {name: plurals(name) & names for name in names if plurals(name) & names}


def test_plurals_are_seen():
    assert "trials" in plurals("trial") and "boxes" in plurals("box") and "bodies" in plurals("body")
    assert "pulses" in plurals("pulse") and "sun_pass" not in plurals("sun_pa")


def test_names_that_differ_by_one_letter_are_seen():
    assert alike("record", "records") and alike("plots", "plot") and alike("trace", "track")
    assert not alike("record", "recorder") and not alike("frame", "motion")


PAPER = re.compile(
    r"\bseed(?:'s)?,? (?:eqs?\.|figs?\.|secs?\.|sections?\b)|\bseed \d\.\d"  # seed eq. 7, seed 3.1.4, the seed's section 5
    r"|\bthe seed(?:'s \d|'s (?:system|camera|lens|paper|light|craft|figures?|instrument|numbers?|introduction)\b"
    r"| (?:says|gives|states|speaks|or another)\b)|[a-z] \(seed\)",
)


def texts():
    """Return the tracked texts in which a person reads of the paper."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout: git knows what is tracked")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    names = [name for name in listing.split("\0") if name.endswith((".py", ".md", ".toml")) and (ROOT / name).is_file()]
    return {name: (ROOT / name).read_text(encoding="utf-8") for name in names}


def test_seed_is_the_seed_of_random_numbers_and_never_the_paper():
    found = {
        f"{name}:{text.count(chr(10), 0, place.start()) + 1}": place[0]
        for name, text in texts().items()
        if name != "tests/house/test_names.py"
        for place in PAPER.finditer(text)
    }
    assert not found, "cite it as 'Fuller et al., eq. 7'"


@pytest.mark.parametrize("text", ["(seed eq. 7)", "seed 3.1.4 says", "the seed's section 5", "Sourced (seed): 1"])
def test_the_paper_is_seen(text):
    assert PAPER.search(text)


@pytest.mark.parametrize("text", ["seed 7", "the scenario's seed", "the seed of the noise", "(seed, k)", "seed=5"])
def test_a_random_seed_is_let_through(text):
    assert not PAPER.search(text)


def parts_of(annotation):
    """Return the names of the parts that an annotation allows."""
    if isinstance(annotation, type) and not get_args(annotation):
        return {annotation.__name__} if issubclass(annotation, Part) else set()
    return set().union(*map(parts_of, get_args(annotation)))


def parts_at(part, field):
    return parts_of(part.model_fields[field].annotation)


KINDS = {  # parts of which a scenario chooses one, and the rooms that may ask which one it is
    "detector": (parts_at(rl.Lidar, "detector"), {"detector"}),
    "motion": (parts_at(rl.motion.Body, "motion"), {"motion", "orbit", "rpo"}),
    "attitude": (parts_at(rl.motion.Body, "attitude"), {"motion"}),
    "angle": (parts_at(rl.motion.HingeAxes, "angle"), {"motion"}),
    "point": (parts_at(rl.Ptu, "point"), {"motion"}),
    "response": (parts_at(rl.Ptu, "response"), {"motion"}),
    "material": (parts_at(rl.Target, "material"), {"scene"}),
    "psf": (parts_at(rl.Receiver, "psf"), {"optics"}),
    "distortion": (parts_at(rl.Receiver, "distortion"), {"optics"}),
}


def names_in(node):
    return {getattr(inner, "id", getattr(inner, "attr", "")) for inner in ast.walk(node)}


def questions(tree):
    """Return each line that asks which class or type something has, with the words of the question."""
    found = []
    for node in walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass"):
            found.append((node.lineno, names_in(node.args[1])))
        elif isinstance(node, ast.MatchClass):
            found.append((node.cls.lineno, names_in(node.cls)))
        elif isinstance(node, ast.Compare):
            text = ast.unparse(node) if "type" in names_in(node) else ""
            found.append((node.lineno, set(re.findall(r"(?=\b(\w+\.type)\b)", text))))
    return found


def lines_about(asked, kind, names):
    """Return the lines of questions that ask which of its kind a part is."""
    return sorted({line for line, words in asked if words & (names | {f"{kind}.type"})})


def test_only_the_room_that_owns_them_asks_which_one_it_is():
    asked = {module: questions(tree) for module, tree in parse("rso_lidar").items()}
    assert sum(map(len, asked.values())) > 1000
    offenders = {}
    for kind, (names, rooms) in KINDS.items():
        assert len(names) > 1
        for module, found in asked.items():
            if module.split("/")[1] not in rooms and (lines := lines_about(found, kind, names)):
                offenders[kind, module] = lines
    assert not offenders


@pytest.mark.parametrize(
    "code",
    [
        "isinstance(lidar.detector, Gsfl)",
        "isinstance(part, Empirical | Gsfl)",
        "match part:\n    case detector.Gsfl(preset=p): pass",
        "x = scenario.lidar.detector.type != 'gsfl'",
    ],
)
def test_a_question_is_seen(code):
    assert lines_about(questions(ast.parse(code)), "detector", {"Gsfl", "Empirical"})
    other = questions(ast.parse("detector.detect(photons); isinstance(x, Laser)"))
    assert not lines_about(other, "detector", {"Gsfl"})


RIDDLES = {"one", "found", "made", "told"}


def riddles(tree):
    """Return the lines that bind a local name which says nothing of the thing that it holds."""
    fields = {id(it.target) for it in walk(tree) if isinstance(it, ast.AnnAssign) and it.value is None}
    stored = [it for it in walk(tree) if isinstance(it, ast.Name) and isinstance(it.ctx, ast.Store)]
    return sorted({it.lineno for it in stored if it.id in RIDDLES and id(it) not in fields})


def test_locals_are_named_after_what_they_hold():
    found = {name: lines for name, tree in parse("rso_lidar").items() if (lines := riddles(tree))}
    assert not found
    assert riddles(ast.parse("for one in rows:\n    pass\nfound = 3\nx = [made for made in rows]")) == [1, 3, 4]
