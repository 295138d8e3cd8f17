"""Defaults of parts that are assumed, by what the description of each field says."""

import functools
import importlib
import inspect
import pkgutil
import re

import rso_lidar as rl
from rso_lidar.part import Part

# The last sentences of a description say where the default comes from: "Default: assumed, a clock of 420 MHz."
_DEFAULT = re.compile(r"\bDefault: (?P<source>.*)", re.DOTALL)


def list_assumed_defaults(names):
    """Return the assumed defaults of parts, as `Part.field`."""
    found = []
    for name in names:
        for field, info in getattr(_parts().get(name), "model_fields", {}).items():
            source = _DEFAULT.search(info.description or "")
            if source and re.search(r"\bassumed\b", source["source"]) and not info.is_required():
                found.append(f"{name}.{field}")
    return found


@functools.cache
def _parts():
    """Return all classes of parts by name."""
    found, classes = {}, [Part]
    for module in pkgutil.walk_packages(rl.__path__, "rso_lidar."):  # rooms load their parts on first use
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    while classes:
        for each in classes.pop().__subclasses__():
            if not inspect.isabstract(each):
                found.setdefault(each.__name__, each)
            classes.append(each)
    return found
