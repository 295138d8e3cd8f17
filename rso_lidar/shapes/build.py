"""The list of builders, by the name that a scenario uses."""

from __future__ import annotations

from collections.abc import Callable

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.shapes.bench import plate, sphere
from rso_lidar.shapes.cubesat import cubesat_3u
from rso_lidar.shapes.dawn import dawn
from rso_lidar.shapes.juno import juno
from rso_lidar.shapes.lro import lro
from rso_lidar.shapes.model import Model
from rso_lidar.shapes.rocket_body import rocket_body
from rso_lidar.shapes.rosetta import rosetta
from rso_lidar.shapes.stardust import stardust
from rso_lidar.shapes.suomi_npp import suomi_npp
from rso_lidar.shapes.tdrs import tdrs


def builders() -> dict[str, Callable[[], Model]]:
    """Return every builder by the name of its model.

    >>> sorted(builders())
    ['cubesat_3u', 'dawn', 'juno', 'lro', 'plate', 'rocket_body', 'rosetta', 'sphere', 'stardust', 'suomi_npp', 'tdrs']
    """
    return {
        builder.__name__: builder
        for builder in (tdrs, juno, dawn, rosetta, stardust, lro, suomi_npp, cubesat_3u, rocket_body, plate, sphere)
    }


def build(name: str) -> Model:
    """Return the model of that name, freshly built.

    >>> build("plate").size_m.tolist()
    [0.002, 4.0, 4.0]
    """
    known = builders()
    if name not in known:
        raise ScenarioError(f"unknown shape '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})")
    return known[name]()
