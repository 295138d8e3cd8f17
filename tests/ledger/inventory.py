"""Inventory of what users can name in files and on the command line; each belongs to one capability of the ledger.

Names are those of the classes of parts, and prefixed ones of what is chosen by a word: ``format:pcd``, ``command:run``,
``preset:gsfl_1064``, ``track:align``, ``Ranging.algorithm=centroid``.
"""

from typing import get_args

import rso_lidar as rl
from rso_lidar.cli.app import COMMANDS
from rso_lidar.export import FORMATS
from rso_lidar.scenario import load_presets
from rso_lidar.study import Requirements, Study

# Fields whose words are models of their own. Words of other fields belong to the capability of their part.
SPLIT = ((rl.detector.Ranging, "algorithm"), (rl.Laser, "footprint"), (rl.Laser, "pulse_shape"))


def list_names():
    """Return the names of everything that must stand in the ledger."""
    names = set()
    for root in (rl.Scenario, rl.dataset.DatasetSpec, Study, Requirements):
        names |= {root.__name__, *root.model_json_schema()["$defs"]}
    for part, field in SPLIT:
        names |= {f"{part.__name__}.{field}={word}" for word in get_args(part.model_fields[field].annotation)}
    names |= {f"format:{name}" for name in FORMATS}
    names |= {f"preset:{name}" for name in load_presets()}
    names |= {f"command:{name}" for name in COMMANDS}
    names |= {f"track:{name}" for name in rl.track.__all__ if not name.isupper()}
    return names


def base_name(name):
    """Return a name without what pydantic adds to it in a schema."""
    return name.partition("[")[0]
