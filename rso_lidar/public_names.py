"""What a room exports: its names load on first use, and `dir` shows them without what the room imports for itself."""

import ast
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec


def limit_dir(room: str, *further: str) -> Callable[[], list[str]]:
    """Make the `__dir__` of a room, a function that lists its `__all__`.

    Parameters
    ----------
    room : full name of the room's module, its ``__name__``
    *further : names to list beside those of `__all__`

    Returns
    -------
    Callable
        The function to bind to `__dir__` in that module.
    """
    return lambda: [*sys.modules[room].__all__, *further]


def export_lazily(room: str) -> Callable[[str], object]:
    """Make the `__getattr__` of a room, which imports each export when it is first used.

    The room states its exports once, as imports under ``if TYPE_CHECKING``. Type checkers and editors read them there, and
    so does this function. It needs the source of the room.

    Parameters
    ----------
    room : full name of the room's module, its ``__name__``

    Returns
    -------
    Callable
        The function to bind to `__getattr__` in that module. It raises `AttributeError` for names that are not exported.
    """

    def get_export(name: str) -> object:
        if name not in (places := _find_exports(room)):
            raise AttributeError(f"module '{room}' has no attribute '{name}'")
        module, original = places[name]
        place = import_module(module)
        if (
            hasattr(place, "__path__") and find_spec(f"{module}.{original}") is not None
        ):  # the export is itself a module
            value: object = import_module(f"{module}.{original}")
        else:
            value = getattr(place, original)
        setattr(sys.modules[room], name, value)  # from now on Python finds it without this function
        return value

    return get_export


@cache
def _find_exports(room: str) -> dict[str, tuple[str, str]]:
    """Return the module and the name there of each export of a room."""
    loader = getattr(sys.modules[room].__spec__, "loader", None)
    source = loader.get_source(room) if loader else None
    if source is None:
        raise ImportError(f"{room}: its source is not there; install the package with its .py files")
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for block in ast.parse(source).body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
