"""Orbits about the Earth: time, catalogues, propagators, ephemerides, and what surrounds a body there."""

from rso_lidar.orbit.ccsds.ephemeris import Ephemeris, write_ephemeris_csv, write_oem
from rso_lidar.orbit.epochs import Epochs, format_utc
from rso_lidar.orbit.propagation.forces import Drag, Forces, RadiationPressure
from rso_lidar.orbit.propagation.j2 import J2
from rso_lidar.orbit.propagation.maneuver import Burn, Impulse
from rso_lidar.orbit.propagation.numerical import Numerical
from rso_lidar.orbit.sets.catalog import Catalog
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.fleet import Fleet
from rso_lidar.orbit.sets.set_sequence import SetSequence
from rso_lidar.orbit.sets.sgp4_motion import Omm, Tle
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.orbit.two_body.kepler import Kepler, State
from rso_lidar.orbit.two_body.lambert import solve_lambert, solve_lambert_all

__all__ = [
    "J2",
    "Burn",
    "Catalog",
    "Drag",
    "ElementSet",
    "Ephemeris",
    "Epochs",
    "Fleet",
    "Forces",
    "Impulse",
    "Kepler",
    "Numerical",
    "Omm",
    "RadiationPressure",
    "SetSequence",
    "State",
    "Tle",
    "Trajectory",
    "format_utc",
    "solve_lambert",
    "solve_lambert_all",
    "write_ephemeris_csv",
    "write_oem",
]
