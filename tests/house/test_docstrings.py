"""Functions that others call state each parameter, and what they return, in sections of numpy style.

What the package or a room exports (functions, and the public methods of classes) has *Parameters*, and *Returns* unless
its first line starts with *Return*. A method is documented in its own docstring, in that of the same method of a base class,
or in a `Protocol` of this package that its class implements with the same names of parameters. A command of the command
line states its parameters in the `help` of its options, from which ``--help`` is made.
"""

import importlib
import inspect
import pkgutil
import re
import typing
from functools import cache

import rso_lidar

SECTION = re.compile(r"^(?P<title>[A-Z][A-Za-z ]+)\n-{3,}$", re.MULTILINE)
NAMES = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: :|$)", re.MULTILINE)


@cache
def modules():
    """Return every module of the package, imported."""
    found = pkgutil.walk_packages(rso_lidar.__path__, "rso_lidar.")
    return [rso_lidar, *(importlib.import_module(it.name) for it in found if not it.name.endswith("__main__"))]


def function_of(thing):
    """Return the function behind a method, a wrapper or a kernel, if it is written in this package."""
    if isinstance(thing, property) or inspect.isclass(thing) or not hasattr(thing, "__module__"):
        return None
    function = inspect.unwrap(getattr(thing, "__func__", thing))
    ours = inspect.isfunction(function) and function.__module__.startswith("rso_lidar")
    return function if ours and function.__code__.co_filename != "<string>" else None  # a dataclass writes some itself


def members(cls):
    """Return the functions that a class defines itself, by name."""
    found = {name: function_of(value) for name, value in dict(vars(cls)).items()}
    return {name: function for name, function in found.items() if function}


def parameters(function):
    """Return the names of the parameters that a caller gives."""
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


@cache
def classes():
    """Return every class of the package."""
    return {
        value
        for module in modules()
        for value in vars(module).values()
        if inspect.isclass(value) and value.__module__.startswith("rso_lidar")
    }


@cache
def protocols():
    """Return the classes that state what an object of a user's own has."""
    return [cls for cls in classes() if getattr(cls, "_is_protocol", False)]


def exported():
    """Return the functions and public methods that the package and its rooms export, each with the class it is seen in."""
    things = [getattr(module, name) for module in modules() for name in getattr(module, "__all__", ())]
    found = {function_of(thing): None for thing in things}
    for cls in filter(inspect.isclass, things):
        for base in inspect.getmro(cls):
            for name, function in members(base).items():
                if name == "__init__" or not name.startswith("_"):
                    found.setdefault(function, cls)
    return {function: cls for function, cls in found.items() if function and parameters(function)}


def docstrings(function, cls):
    """Return the texts that may document a function, its own first."""
    name, texts = function.__name__, [inspect.getdoc(function) or ""]
    if cls is None:
        return texts
    if name == "__init__":
        return [*texts, inspect.getdoc(cls) or ""]
    bases = [base for base in inspect.getmro(cls)[1:] if name in vars(base)]
    bases += [it for it in protocols() if name in vars(it) and all(hasattr(cls, member) for member in members(it))]
    alike = [function_of(vars(base)[name]) for base in bases]
    return texts + [inspect.getdoc(it) or "" for it in alike if it and parameters(it) == parameters(function)]


def sections(text):
    """Return the sections of a docstring by title."""
    parts = SECTION.split(text)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def described(text):
    """Return the names that a docstring describes as parameters."""
    found = sections(text)
    entries = NAMES.findall(found.get("Parameters", "") + found.get("Other Parameters", ""))
    return {name.lstrip("*") for entry in entries for name in entry.split(", ")}


def is_command(function):
    """Return whether all parameters are options or arguments of the command line that have a help text."""
    if not function.__module__.startswith("rso_lidar.cli."):
        return False
    hints = typing.get_type_hints(function, include_extras=True)
    notes = [getattr(hints[name], "__metadata__", ()) for name in parameters(function)]
    return all(any(getattr(note, "help", "") for note in of_one) for of_one in notes)


def gives(function):
    """Return whether a function returns or yields a value."""
    nothing = (None, "None", typing.NoReturn, "NoReturn", "Self", inspect.Signature.empty)
    return inspect.signature(function).return_annotation not in nothing


def undescribed(function, cls):
    """Return the parameters of a function that none of its docstrings describes."""
    if is_command(function):
        return []
    names, texts = parameters(function), docstrings(function, cls)
    return min(([name for name in names if name not in described(text)] for text in texts), key=len)


def has_value(function, cls):
    """Return whether the docstrings of a function state what it returns, if it returns anything."""
    states = any(
        {"Returns", "Yields"} & sections(it).keys() or it.startswith("Return ") for it in docstrings(function, cls)
    )
    return states or not gives(function)


def faults():
    """Return what docstrings leave out, by room and name of the function."""
    found = {}
    for function, cls in exported().items():
        missing = undescribed(function, cls)
        if not has_value(function, cls):
            missing.append("Returns")
        if missing:
            found[f"{function.__module__.split('.')[1]}: {function.__qualname__}"] = missing
    return found


def test_functions_state_their_parameters_and_values():
    assert not faults()


def read(distance_m, *rows, **options):
    """Read a table.

    Parameters
    ----------
    distance_m : of the far end [m].
    *rows, **options : of the table.

    Raises
    ------
    OSError
        If there is no table.
    """


NOISE = re.compile(r"^\*{0,2}(\w+(?:, \*{0,2}\w+)*) : ((?:[a-z]+,? ?){1,3})$", re.MULTILINE)  # "flight : the flight"
TELLING = re.compile(r"\b(axes|rows|columns|pixels|cells|indices|radians|tangents|seed|written|number|time|missing)\b")


def noise(function):
    """Return the entries of a docstring that tell no unit, shape, number or default: up to three plain words."""
    entries = NOISE.findall(sections(inspect.getdoc(function) or "").get("Parameters", ""))
    return [f"{name} : {text}" for name, text in entries if not TELLING.search(text)]


def test_private_functions_have_no_entries_that_tell_nothing():
    found = {}
    for holder in (*modules(), *classes()):
        for name, function in members(holder).items():
            if name.startswith("_") and name != "__init__" and (empty := noise(function)):
                found[f"{function.__module__}: {function.__qualname__}"] = empty
    assert not found


def test_an_entry_that_tells_nothing_is_seen():
    def _fly(flight, rows, time_s):
        """Fly.

        Parameters
        ----------
        flight : the flight
        rows : rows of pixels
        time_s : (time,) [s]
        """

    assert noise(_fly) == ["flight : the flight"]


def test_what_is_left_out_is_seen():
    assert len(exported()) > 300 and len(protocols()) > 5
    assert described(inspect.getdoc(read)) == {"distance_m", "rows", "options"}
    assert sections(inspect.getdoc(read)).keys() == {"Parameters", "Raises"}
    assert not undescribed(read, None) and undescribed(lambda x, rows: None, None) == ["x", "rows"]
