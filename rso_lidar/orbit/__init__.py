"""Orbits about the Earth or the Moon: time scales, element sets, propagators, ephemerides, conjunctions and eclipses.

Everything is in GCRS axes from the Earth's centre and in SI units, unless a name or a docstring states otherwise.

**Motions** fill a scenario's `motion` table, and answer `states(epochs)` as every `Trajectory` does:

- `Tle` and `Omm`: SGP4, from element sets of a file or catalogue, or from one message written inline.
- `Kepler` and `State`: two-body motion from osculating elements, or from a position and a velocity. `read_opm` reads the
  state of a CCSDS OPM.
- `J2`: mean elements with the secular and short-period effects of J2.
- `Numerical`: numerical integration with `Forces` (`Drag`, `RadiationPressure`), `Impulse` and `Burn`.
- `Ephemeris`: interpolation of a table of states (CCSDS OEM or CSV).
- `LunarKepler` and `LunarState`: two-body motion about the Moon, whose position a user's kernel gives.

**Element sets.** `Catalog` reads and filters them, and `ElementSet` is one of them. `SetSequence` is the trajectory of one
object from several of its sets; `Fleet` propagates thousands of sets side by side. They hold the mean elements of SGP4,
which only SGP4 may propagate. `OsculatingElements` are those of one state; `mean_from_osculating` gives those of `J2`.

**The Earth below.** `GroundStation` is a place on the ground, `find_ground_track` gives latitudes and longitudes, and
`EarthOrientation` reads polar motion and UT1. `gcrs_from_axes` and `convert_states` know the named axes. `JplEphemeris`
reads Sun, Moon and planets from a user's kernel.

**Conjunctions.** `ConjunctionMessage` reads a CDM. `foster_probability` and `sample_collisions` give the probability of
collision of two states with covariance (`UncertainState`).

**Functions.** `screen` finds close approaches to one object and `screen_pairs` those of any two, `find_eclipses` passages
through the Earth's shadow, `find_access` when one object sees another, and `solve_lambert` the orbit between two positions.
`propagate_two_body` and `propagate_sgp4` need no scenario.
"""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.orbit.ccsds.conjunction_message import ConjunctionMessage, ConjunctionObject
    from rso_lidar.orbit.ccsds.ephemeris import Ephemeris
    from rso_lidar.orbit.ccsds.state_message import read_opm
    from rso_lidar.orbit.ccsds.writer import write_ephemeris_csv, write_oem
    from rso_lidar.orbit.collision.foster import foster_probability
    from rso_lidar.orbit.collision.monte_carlo import SampledProbability, sample_collisions
    from rso_lidar.orbit.collision.uncertain_state import UncertainSeparation, UncertainState
    from rso_lidar.orbit.earth.access import Access, find_access
    from rso_lidar.orbit.earth.axes import convert_states, gcrs_from_axes
    from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
    from rso_lidar.orbit.earth.earth_rotation import itrs_from_gcrs
    from rso_lidar.orbit.earth.ellipsoid import Geodetic, geodetic_from_itrs, itrs_from_geodetic
    from rso_lidar.orbit.earth.ground import GroundStation, LookAngles, find_ground_track
    from rso_lidar.orbit.epochs import Epochs, format_utc
    from rso_lidar.orbit.propagation.forces import Drag, Forces, RadiationPressure
    from rso_lidar.orbit.propagation.j2 import J2, mean_from_osculating, osculating_from_mean
    from rso_lidar.orbit.propagation.lunar_orbit import LunarKepler, LunarState
    from rso_lidar.orbit.propagation.maneuver import Burn, Impulse
    from rso_lidar.orbit.propagation.numerical import Numerical, integrate_orbit
    from rso_lidar.orbit.screening.all_pairs import PairScreening, screen_pairs
    from rso_lidar.orbit.screening.close_approach import CloseApproach
    from rso_lidar.orbit.screening.conjunctions import ScreeningResult, screen
    from rso_lidar.orbit.screening.trajectory_piece import NamedTrajectory
    from rso_lidar.orbit.sets.catalog import Catalog
    from rso_lidar.orbit.sets.element_set import ElementSet
    from rso_lidar.orbit.sets.fleet import Fleet
    from rso_lidar.orbit.sets.set_sequence import SetSequence
    from rso_lidar.orbit.sets.sgp4_motion import Omm, Tle
    from rso_lidar.orbit.sets.teme import gcrs_from_teme, propagate_sgp4
    from rso_lidar.orbit.sky.eclipse import Eclipse, find_eclipses, sunlit_fraction
    from rso_lidar.orbit.sky.geometry import (
        beta_angle_rad,
        earth_angular_radius_rad,
        earth_limb_angle_rad,
        line_altitude_m,
        phase_angle_rad,
    )
    from rso_lidar.orbit.sky.jpl_ephemeris import JplEphemeris
    from rso_lidar.orbit.sky.moon import moon_position_m
    from rso_lidar.orbit.sky.sun import sun_position_m
    from rso_lidar.orbit.trajectory import Trajectory
    from rso_lidar.orbit.two_body.anomaly import eccentric_from_mean, mean_from_true, true_from_mean
    from rso_lidar.orbit.two_body.kepler import Kepler, State, propagate_two_body
    from rso_lidar.orbit.two_body.lambert import Transfer, solve_lambert, solve_lambert_all
    from rso_lidar.orbit.two_body.osculating_elements import (
        OsculatingElements,
        elements_from_state,
        state_from_elements,
    )

__all__ = [
    "J2",
    "Access",
    "Burn",
    "Catalog",
    "CloseApproach",
    "ConjunctionMessage",
    "ConjunctionObject",
    "Drag",
    "EarthOrientation",
    "Eclipse",
    "ElementSet",
    "Ephemeris",
    "Epochs",
    "Fleet",
    "Forces",
    "Geodetic",
    "GroundStation",
    "Impulse",
    "JplEphemeris",
    "Kepler",
    "LookAngles",
    "LunarKepler",
    "LunarState",
    "NamedTrajectory",
    "Numerical",
    "Omm",
    "OsculatingElements",
    "PairScreening",
    "RadiationPressure",
    "SampledProbability",
    "ScreeningResult",
    "SetSequence",
    "State",
    "Tle",
    "Trajectory",
    "Transfer",
    "UncertainSeparation",
    "UncertainState",
    "beta_angle_rad",
    "convert_states",
    "earth_angular_radius_rad",
    "earth_limb_angle_rad",
    "eccentric_from_mean",
    "elements_from_state",
    "find_access",
    "find_eclipses",
    "find_ground_track",
    "format_utc",
    "foster_probability",
    "gcrs_from_axes",
    "gcrs_from_teme",
    "geodetic_from_itrs",
    "integrate_orbit",
    "itrs_from_gcrs",
    "itrs_from_geodetic",
    "line_altitude_m",
    "mean_from_osculating",
    "mean_from_true",
    "moon_position_m",
    "osculating_from_mean",
    "phase_angle_rad",
    "propagate_sgp4",
    "propagate_two_body",
    "read_opm",
    "sample_collisions",
    "screen",
    "screen_pairs",
    "solve_lambert",
    "solve_lambert_all",
    "state_from_elements",
    "sun_position_m",
    "sunlit_fraction",
    "true_from_mean",
    "write_ephemeris_csv",
    "write_oem",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
