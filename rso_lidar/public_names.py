"""What `dir` and completion show of a room: its exported names, without what its `__init__` imports for itself."""

import sys
from collections.abc import Callable


def limit_dir(room: str, *further: str) -> Callable[[], list[str]]:
    """Make the `__dir__` of a room, a function that lists its `__all__`.

    Parameters
    ----------
    room : full name of the room's module, its ``__name__``.
    *further : names to list beside those of `__all__`.

    Returns
    -------
    Callable
        The function to bind to `__dir__` in that module.
    """
    return lambda: [*sys.modules[room].__all__, *further]
