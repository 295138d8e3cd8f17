"""Orbits about the Earth: time, catalogues, propagators, ephemerides, and what surrounds a body there."""

from rso_lidar.orbit.catalog import Catalog
from rso_lidar.orbit.element_set import ElementSet
from rso_lidar.orbit.epochs import Epochs, utc_text
from rso_lidar.orbit.fleet import Fleet
from rso_lidar.orbit.forces import Drag, Forces, RadiationPressure
from rso_lidar.orbit.kepler import Kepler, State
from rso_lidar.orbit.lambert import lambert, lambert_all
from rso_lidar.orbit.maneuver import Burn, Impulse
from rso_lidar.orbit.mean_elements import J2
from rso_lidar.orbit.numerical import Numerical
from rso_lidar.orbit.oem import Ephemeris, write_ephemeris_csv, write_oem
from rso_lidar.orbit.omm import Omm
from rso_lidar.orbit.sgp4_orbit import SeveralSets, Tle
from rso_lidar.orbit.trajectory import Trajectory

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
    "SeveralSets",
    "State",
    "Tle",
    "Trajectory",
    "lambert",
    "lambert_all",
    "utc_text",
    "write_ephemeris_csv",
    "write_oem",
]
