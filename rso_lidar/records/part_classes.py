"""Common part classes: one short list of names for parts of any spacecraft, for learning across craft."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

PartClass = Literal[
    "bus",
    "solar_array",
    "antenna",
    "boom",
    "radiator",
    "shield",
    "instrument",
    "engine",
    "thruster",
    "tank",
    "adapter",
    "mechanism",
    "line",
    "marker",
    "fragment",
    "other",
]

OTHER: PartClass = "other"

# Labels are numbers in this order. New classes may be added before "other", in a new version of the files only.
PART_CLASSES: Mapping[PartClass, str] = MappingProxyType(
    {
        "bus": "Main body: structure, decks, cabin, equipment boxes, and what is fixed flat to it.",
        "solar_array": "Solar cells and the substrate that carries them, on wings or on the body.",
        "antenna": "Antennas: reflectors with feeds and struts, horns, patches, whips, phased arrays.",
        "boom": "Slender structure that holds something away from the body: booms, masts, yokes, struts, arms.",
        "radiator": "Radiators and louvers.",
        "shield": "Heat shields, dust shields, covers and insulation.",
        "instrument": "Instruments, cameras, star trackers and other payload, with baffles and lenses.",
        "engine": "Main engines with their nozzles and thrust structure.",
        "thruster": "Small engines for attitude and orbit, with their brackets.",
        "tank": "Tanks and pressure vessels, also tanks whose wall is the wall of a stage.",
        "adapter": "Structure that joins a craft to a launcher, a stage or another craft: rings, cones, skirts, ports.",
        "mechanism": "Hinges, drives, gimbals and release devices.",
        "line": "Feed lines, umbilicals, cable ducts and tunnels.",
        "marker": "Retro-reflectors and visual markers, with their brackets.",
        "fragment": "Debris structure whose original place on a craft is not recognisable.",
        "other": "Anything else, and parts that are not mapped.",
    }
)
