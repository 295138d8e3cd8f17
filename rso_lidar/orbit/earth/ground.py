"""The ground below an orbit: the track of a spacecraft, stations, and the directions in which they see it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.central_body import check_trajectory
from rso_lidar.orbit.earth.axes import convert_states
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.earth.earth_rotation import itrs_from_gcrs
from rso_lidar.orbit.earth.ellipsoid import Geodetic, geodetic_from_itrs, itrs_from_geodetic, itrs_from_horizon
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState

_HIGHEST_M = 1e6  # of a station; what is higher orbits


@dataclass(frozen=True, eq=False)
class LookAngles:
    """Directions and distances of a spacecraft seen from a station, without refraction and light time.

    Parameters
    ----------
    azimuth_rad : (time,) from north by east, 0 to 2 pi [rad]
    elevation_rad : (time,) above the horizon of the ellipsoid [rad]
    range_m : (time,) [m]
    range_rate_m_s : (time,) [m/s]
    """

    azimuth_rad: np.ndarray
    elevation_rad: np.ndarray
    range_m: np.ndarray
    range_rate_m_s: np.ndarray


@dataclass(frozen=True, eq=False)
class GroundStation:
    """A place fixed to the ground, which is a trajectory too: `states` gives its GCRS states.

    Parameters
    ----------
    latitude_deg, longitude_deg : geodetic (WGS84), north and east positive [deg]
    height_m : above the ellipsoid [m]
    least_elevation_deg : elevation above which the station sees a spacecraft [deg]
    orientation : polar motion and UT1, see `itrs_from_gcrs`
    name : of the station

    Raises
    ------
    ScenarioError
        if a number is outside its limits

    Examples
    --------
    >>> import datetime
    >>> from rso_lidar.orbit.two_body.kepler import Kepler
    >>> start = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
    >>> low = Kepler(epoch_utc=start, semi_major_axis_km=6778.137, eccentricity=0.001, inclination_deg=51.6, raan_deg=40,
    ...     argument_of_perigee_deg=0, true_anomaly_deg=60)
    >>> seen = GroundStation(47.07, 15.49, 540.0).see(low, Epochs(start, np.array([0.0, 60.0])))
    >>> seen.elevation_rad.shape
    (2,)
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0
    least_elevation_deg: float = 0.0
    orientation: EarthOrientation | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for key, most in (
            ("latitude_deg", 90.0),
            ("longitude_deg", 360.0),
            ("height_m", _HIGHEST_M),
            ("least_elevation_deg", 90.0),
        ):
            value = getattr(self, key)
            if isinstance(value, bool) or not isinstance(value, int | float) or not -most <= value <= most:
                raise ScenarioError(f"station {self.name}: {key}: {value!r:.40} is not within {most:g}; correct it")

    @property
    def place(self) -> Geodetic:
        """The station's geodetic coordinates."""
        latitude, longitude = self.latitude_deg * units.DEG, self.longitude_deg * units.DEG
        return Geodetic(np.asarray(latitude), np.asarray(longitude), np.asarray(float(self.height_m)))

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        fixed = np.broadcast_to(itrs_from_geodetic(self.place), (len(epochs), 3))
        still = BodyState(fixed, np.zeros((len(epochs), 3)))
        return convert_states(still, epochs, from_axes="itrs", orientation=self.orientation)

    def see(self, trajectory: Trajectory, epochs: Epochs) -> LookAngles:
        """Compute where the station sees a spacecraft.

        Parameters
        ----------
        trajectory : anything that answers `states`
        epochs : instants

        Returns
        -------
        LookAngles
        """
        check_trajectory(trajectory, "trajectory")
        flown = convert_states(trajectory.states(epochs), epochs, to_axes="itrs", orientation=self.orientation)
        line_m = flown.position_m - itrs_from_geodetic(self.place)
        east, north, up = rotate_vectors(itrs_from_horizon(self.place).T, line_m).T
        range_m = np.sqrt(np.sum(line_m**2, axis=-1))
        rate_m_s = np.sum(line_m * flown.velocity_m_s, axis=-1) / range_m
        azimuth = np.arctan2(east, north) % math.tau
        return LookAngles(azimuth, np.arctan2(up, np.hypot(east, north)), range_m, rate_m_s)

    def elevation_rad(self, position_m: np.ndarray, epochs: Epochs) -> np.ndarray:
        """Return the elevation (time,) [rad] of GCRS positions.

        Parameters
        ----------
        position_m : (time, 3) [m]
        epochs : their instants
        """
        fixed = rotate_vectors(itrs_from_gcrs(epochs, self.orientation), position_m)
        line_m = fixed - itrs_from_geodetic(self.place)
        east, north, up = rotate_vectors(itrs_from_horizon(self.place).T, line_m).T
        elevation: np.ndarray = np.arctan2(up, np.hypot(east, north))
        return elevation


def find_ground_track(trajectory: Trajectory, epochs: Epochs, orientation: EarthOrientation | None = None) -> Geodetic:
    """Return the geodetic coordinates (time,) of a spacecraft; those of the ground track are its latitudes and longitudes.

    Parameters
    ----------
    trajectory : anything that answers `states`
    epochs : instants
    orientation : polar motion and UT1, see `itrs_from_gcrs`

    Examples
    --------
    >>> import datetime
    >>> from rso_lidar.orbit.two_body.kepler import Kepler
    >>> start = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
    >>> low = Kepler(epoch_utc=start, semi_major_axis_km=6778.137, eccentricity=0.0, inclination_deg=51.6, raan_deg=40,
    ...     argument_of_perigee_deg=0, true_anomaly_deg=90)
    >>> track = find_ground_track(low, Epochs(start, np.zeros(1)))
    >>> (track.latitude_rad / units.DEG).round(1), (track.height_m / units.KM).round(0)  # 400 km above the equator's radius
    (array([51.7]), array([413.]))
    """
    check_trajectory(trajectory, "trajectory")
    return geodetic_from_itrs(rotate_vectors(itrs_from_gcrs(epochs, orientation), trajectory.states(epochs).position_m))
