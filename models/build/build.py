"""The builders of the shipped models, by the name that a scenario uses."""

from __future__ import annotations

from collections.abc import Callable

from models.build.bench import plate, sphere
from models.build.capsule import capsule
from models.build.comsat import comsat
from models.build.cubesat import cubesat_1u, cubesat_3u, cubesat_6u, cubesat_12u
from models.build.dawn import dawn
from models.build.debris import debris_foil, debris_panel, debris_plate, debris_shard
from models.build.envisat import envisat
from models.build.juno import juno
from models.build.lro import lro
from models.build.rocket_body import rocket_body
from models.build.rosetta import rosetta
from models.build.stardust import stardust
from models.build.suomi_npp import suomi_npp
from models.build.tdrs import tdrs
from models.build.zenit_stage import zenit_stage
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.shapes import CraftModel

_BUILDERS: tuple[Callable[[], CraftModel], ...] = (
    tdrs,
    juno,
    dawn,
    rosetta,
    stardust,
    lro,
    suomi_npp,
    envisat,
    comsat,
    cubesat_1u,
    cubesat_3u,
    cubesat_6u,
    cubesat_12u,
    rocket_body,
    zenit_stage,
    capsule,
    debris_plate,
    debris_shard,
    debris_panel,
    debris_foil,
    plate,
    sphere,
)


def builders() -> dict[str, Callable[[], CraftModel]]:
    """Return every builder by the name of its model.

    >>> [name for name in builders() if name.startswith("cubesat")]
    ['cubesat_1u', 'cubesat_3u', 'cubesat_6u', 'cubesat_12u']
    """
    return {builder.__name__: builder for builder in _BUILDERS}


def build(name: str) -> CraftModel:
    """Build a shipped model by its name.

    Parameters
    ----------
    name : of a builder, as listed by `builders`

    Returns
    -------
    CraftModel
        The model, freshly built.

        >>> build("plate").size_m.tolist()
        [0.002, 4.0, 4.0]

    Raises
    ------
    ScenarioError
        If there is no builder of that name.
    """
    known = builders()
    if name not in known:
        raise ScenarioError(f"unknown shape '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})")
    return known[name]()
