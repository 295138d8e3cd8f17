"""Orbits about the Earth or the Moon: time scales, element sets, propagators, ephemerides, conjunctions and eclipses.

Everything is in GCRS axes from the Earth's centre and in SI units, unless a name or a docstring states otherwise.

**Motions** fill a scenario's `motion` table, and answer `states(epochs)` as every `Trajectory` does:

- `Tle` and `Omm`: SGP4, from element sets of a file or catalogue, or from one message written inline.
- `Kepler` and `State`: two-body motion from osculating elements, or from a position and a velocity. `read_opm` reads the
  state of a CCSDS OPM.
- `Opm`: integration from a CCSDS OPM with the maneuvers of the message. `OrbitParameterMessage` has its covariance too,
  and `write_opm` writes one.
- `J2`: mean elements with the secular and short-period effects of J2.
- `Numerical`: numerical integration with `Forces` (`Gravity`, `Drag` in an
  `ExponentialAtmosphere` or `NrlmsisAtmosphere`, `RadiationPressure`), `Impulse` and `Burn`.
- `Ephemeris`: interpolation of a table of states (CCSDS OEM or CSV).
- `SpiceMotion`: kernels of NAIF's SPICE toolkit, with the extra `spice`; `write_spk` and `write_ck` write kernels.
- `LunarKepler` and `LunarState`: two-body motion about the Moon, whose position a user's kernel gives.

**Element sets.** `Catalog` reads and filters them, and `ElementSet` is one of them. `SetSequence` is the trajectory of one
object from several of its sets; `Fleet` propagates thousands of sets side by side. They hold the mean elements of SGP4,
which only SGP4 may propagate. `OsculatingElements` are those of one state; `mean_from_osculating` gives those of `J2`.

**The Earth below.** `GroundStation` is a place on the ground, `find_ground_track` gives latitudes and longitudes, and
`EarthOrientation` reads polar motion and UT1. `gcrs_from_axes` and `convert_states` know the named axes. `JplEphemeris`
reads Sun, Moon and planets from a user's kernel.

**Measurements.** `TrackingDataMessage` reads ranges and angles of a TDM, and `write_tdm` writes them.

**Covariances.** `read_covariances` reads those of an OEM, OPM or CDM as a `CovarianceHistory`, which gives them between its
epochs; `write_oem` writes them. `gcrs_state_matrix` takes states and covariances from any named axes to GCRS.

**Conjunctions.** `ConjunctionMessage` reads a CDM. `foster_probability`, `integrate_collisions` and `sample_collisions` give
the probability of collision of two states with covariance (`UncertainState`); `estimate_collision` chooses between them.

**Functions.** `screen` finds close approaches to one object and `screen_pairs` those of any two, `find_eclipses` passages
through the Earth's shadow, `find_access` when one object sees another, `find_bounded_spans`
when any condition of bounded rate holds, and `solve_lambert` the orbit between two positions.
`propagate_two_body` and `propagate_sgp4` need no scenario.
"""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.orbit.ccsds.attitude_file import read_attitudes, write_aem, write_attitude_csv
    from rso_lidar.orbit.ccsds.conjunction_message import ConjunctionMessage, ConjunctionObject
    from rso_lidar.orbit.ccsds.covariance_file import read_covariances
    from rso_lidar.orbit.ccsds.csv_table import read_csv_table
    from rso_lidar.orbit.ccsds.ephemeris import Ephemeris
    from rso_lidar.orbit.ccsds.ephemeris_arc import list_ephemeris_objects
    from rso_lidar.orbit.ccsds.reader import is_message_of, read_table_text
    from rso_lidar.orbit.ccsds.state_message import OrbitParameterMessage, StatedManeuver, read_opm
    from rso_lidar.orbit.ccsds.table_segment import locate_epochs
    from rso_lidar.orbit.ccsds.tracking_message import TrackingDataMessage, TrackingSegment, write_tdm
    from rso_lidar.orbit.ccsds.writer import write_ephemeris_csv, write_oem, write_opm
    from rso_lidar.orbit.central_body import EARTH, CentralBody, find_center, find_center_states, subtract_center
    from rso_lidar.orbit.collision.coppola import IntegratedProbability, KnownTooWellError, integrate_collisions
    from rso_lidar.orbit.collision.foster import foster_probability
    from rso_lidar.orbit.collision.method_choice import CollisionEstimate, estimate_collision
    from rso_lidar.orbit.collision.monte_carlo import SampledProbability, sample_collisions
    from rso_lidar.orbit.collision.uncertain_state import UncertainSeparation, UncertainState, check_radius
    from rso_lidar.orbit.earth.access import Access, find_access
    from rso_lidar.orbit.earth.axes import convert_states, gcrs_from_axes, gcrs_state_matrix
    from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
    from rso_lidar.orbit.earth.earth_rotation import itrs_from_gcrs
    from rso_lidar.orbit.earth.ellipsoid import Geodetic, geodetic_from_itrs, itrs_from_geodetic
    from rso_lidar.orbit.earth.ground import GroundStation, LookAngles, find_ground_track
    from rso_lidar.orbit.earth.pair_conditions import (
        LIMB_ANGLE_RAD,
        LINE_ALTITUDE_M,
        MOON_ANGLE_RAD,
        PHASE_RAD,
        RANGE_M,
        SLEW_RAD_S,
        SPEED_M_S,
        SUN_ANGLE_RAD,
        MotionBounds,
        PairCondition,
        PairQuantity,
        PairSamples,
        elevation_rad,
        rtn_angle_rad,
        sun_height_rad,
    )
    from rso_lidar.orbit.epochs import Epochs, format_utc
    from rso_lidar.orbit.propagation.atmosphere import ExponentialAtmosphere, NrlmsisAtmosphere
    from rso_lidar.orbit.propagation.facet_model import FacetForces, FacetModel, Finish, find_load
    from rso_lidar.orbit.propagation.forces import Drag, Forces, RadiationPressure, find_pressures_n_m2
    from rso_lidar.orbit.propagation.gravity import Gravity
    from rso_lidar.orbit.propagation.integrator import OdeSolution
    from rso_lidar.orbit.propagation.j2 import (
        J2,
        mean_from_osculating,
        osculating_from_mean,
        propagate_j2_secular,
        quasi_nonsingular_from_state,
        state_from_quasi_nonsingular,
    )
    from rso_lidar.orbit.propagation.lunar_orbit import LunarKepler, LunarState
    from rso_lidar.orbit.propagation.maneuver import Burn, Impulse, describe_late_maneuvers, rotate_to_inertial
    from rso_lidar.orbit.propagation.message_orbit import Opm
    from rso_lidar.orbit.propagation.numerical import (
        ForceModel,
        Initial,
        IntegratedOrbit,
        Maneuver,
        Numerical,
        integrate_orbit,
    )
    from rso_lidar.orbit.screening.all_pairs import PairScreening, screen_pairs
    from rso_lidar.orbit.screening.close_approach import CloseApproach
    from rso_lidar.orbit.screening.conjunctions import ScreeningResult, screen
    from rso_lidar.orbit.screening.scheduled_fleet import ScheduledFleet
    from rso_lidar.orbit.screening.trajectory_piece import NamedTrajectory
    from rso_lidar.orbit.sets.catalog import Catalog
    from rso_lidar.orbit.sets.element_set import ElementSet
    from rso_lidar.orbit.sets.fleet import Fleet
    from rso_lidar.orbit.sets.formats import parse_element_sets, read_element_sets
    from rso_lidar.orbit.sets.selection import select_object
    from rso_lidar.orbit.sets.set_sequence import SetSequence
    from rso_lidar.orbit.sets.sgp4_motion import Omm, Tle
    from rso_lidar.orbit.sets.teme import STALE_DAYS, gcrs_from_teme, propagate_sgp4
    from rso_lidar.orbit.sky.eclipse import Eclipse, find_eclipses, shadow_margins_rad, sunlit_fraction
    from rso_lidar.orbit.sky.event_search import (
        BoundedFunction,
        find_bounded_spans,
        find_minima,
        find_minimum,
        find_spans_below,
        join_spans,
    )
    from rso_lidar.orbit.sky.geometry import (
        angle_rad,
        beta_angle_rad,
        earth_angular_radius_rad,
        earth_limb_angle_rad,
        line_altitude_m,
        phase_angle_rad,
    )
    from rso_lidar.orbit.sky.jpl_ephemeris import JplEphemeris
    from rso_lidar.orbit.sky.moon import moon_position_m
    from rso_lidar.orbit.sky.precession import equator_axes
    from rso_lidar.orbit.sky.sun import sun_position_m
    from rso_lidar.orbit.spice.kernel_states import SpiceMotion, read_spice_attitude
    from rso_lidar.orbit.spice.kernel_writers import write_ck, write_spk
    from rso_lidar.orbit.trajectory import Trajectory, differentiate, find_breaks_s, state_rates, two_body_rates
    from rso_lidar.orbit.two_body.anomaly import eccentric_from_mean, mean_from_true, solve_kepler, true_from_mean
    from rso_lidar.orbit.two_body.covariance_history import (
        CovarianceHistory,
        check_covariances,
        describe_unlikely_units,
    )
    from rso_lidar.orbit.two_body.izzo import Branch
    from rso_lidar.orbit.two_body.kepler import Kepler, State, propagate_two_body
    from rso_lidar.orbit.two_body.lambert import Transfer, Way, solve_lambert, solve_lambert_all
    from rso_lidar.orbit.two_body.orbit_axes import (
        invert_state_matrix,
        orbit_state_matrix,
        rtn_axes,
        rtn_from_lvlh_ccsds,
        rtn_matrix,
        state_matrix,
    )
    from rso_lidar.orbit.two_body.osculating_elements import (
        OsculatingElements,
        elements_from_state,
        state_from_elements,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "EARTH",
    "J2",
    "LIMB_ANGLE_RAD",
    "LINE_ALTITUDE_M",
    "MOON_ANGLE_RAD",
    "PHASE_RAD",
    "RANGE_M",
    "SLEW_RAD_S",
    "SPEED_M_S",
    "STALE_DAYS",
    "SUN_ANGLE_RAD",
    "Access",
    "BoundedFunction",
    "Branch",
    "Burn",
    "Catalog",
    "CentralBody",
    "CloseApproach",
    "CollisionEstimate",
    "ConjunctionMessage",
    "ConjunctionObject",
    "CovarianceHistory",
    "Drag",
    "EarthOrientation",
    "Eclipse",
    "ElementSet",
    "Ephemeris",
    "Epochs",
    "ExponentialAtmosphere",
    "FacetForces",
    "FacetModel",
    "Finish",
    "Fleet",
    "ForceModel",
    "Forces",
    "Geodetic",
    "Gravity",
    "GroundStation",
    "Impulse",
    "Initial",
    "IntegratedOrbit",
    "IntegratedProbability",
    "JplEphemeris",
    "Kepler",
    "KnownTooWellError",
    "LookAngles",
    "LunarKepler",
    "LunarState",
    "Maneuver",
    "MotionBounds",
    "NamedTrajectory",
    "NrlmsisAtmosphere",
    "Numerical",
    "OdeSolution",
    "Omm",
    "Opm",
    "OrbitParameterMessage",
    "OsculatingElements",
    "PairCondition",
    "PairQuantity",
    "PairSamples",
    "PairScreening",
    "RadiationPressure",
    "SampledProbability",
    "ScheduledFleet",
    "ScreeningResult",
    "SetSequence",
    "SpiceMotion",
    "State",
    "StatedManeuver",
    "Tle",
    "TrackingDataMessage",
    "TrackingSegment",
    "Trajectory",
    "Transfer",
    "UncertainSeparation",
    "UncertainState",
    "Way",
    "angle_rad",
    "beta_angle_rad",
    "check_covariances",
    "check_radius",
    "convert_states",
    "describe_late_maneuvers",
    "describe_unlikely_units",
    "differentiate",
    "earth_angular_radius_rad",
    "earth_limb_angle_rad",
    "eccentric_from_mean",
    "elements_from_state",
    "elevation_rad",
    "equator_axes",
    "estimate_collision",
    "find_access",
    "find_bounded_spans",
    "find_breaks_s",
    "find_center",
    "find_center_states",
    "find_eclipses",
    "find_ground_track",
    "find_load",
    "find_minima",
    "find_minimum",
    "find_pressures_n_m2",
    "find_spans_below",
    "format_utc",
    "foster_probability",
    "gcrs_from_axes",
    "gcrs_from_teme",
    "gcrs_state_matrix",
    "geodetic_from_itrs",
    "integrate_collisions",
    "integrate_orbit",
    "invert_state_matrix",
    "is_message_of",
    "itrs_from_gcrs",
    "itrs_from_geodetic",
    "join_spans",
    "line_altitude_m",
    "list_ephemeris_objects",
    "locate_epochs",
    "mean_from_osculating",
    "mean_from_true",
    "moon_position_m",
    "orbit_state_matrix",
    "osculating_from_mean",
    "parse_element_sets",
    "phase_angle_rad",
    "propagate_j2_secular",
    "propagate_sgp4",
    "propagate_two_body",
    "quasi_nonsingular_from_state",
    "read_attitudes",
    "read_covariances",
    "read_csv_table",
    "read_element_sets",
    "read_opm",
    "read_spice_attitude",
    "read_table_text",
    "rotate_to_inertial",
    "rtn_angle_rad",
    "rtn_axes",
    "rtn_from_lvlh_ccsds",
    "rtn_matrix",
    "sample_collisions",
    "screen",
    "screen_pairs",
    "select_object",
    "shadow_margins_rad",
    "solve_kepler",
    "solve_lambert",
    "solve_lambert_all",
    "state_from_elements",
    "state_from_quasi_nonsingular",
    "state_matrix",
    "state_rates",
    "subtract_center",
    "sun_height_rad",
    "sun_position_m",
    "sunlit_fraction",
    "true_from_mean",
    "two_body_rates",
    "write_aem",
    "write_attitude_csv",
    "write_ck",
    "write_ephemeris_csv",
    "write_oem",
    "write_opm",
    "write_spk",
    "write_tdm",
]

__dir__ = limit_dir(__name__)
