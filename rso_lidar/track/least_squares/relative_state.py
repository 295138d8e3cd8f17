"""A relative orbit from ranges and lines of sight: batch least squares of position and velocity, with their covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, rtn_matrix
from rso_lidar.records import BodyState
from rso_lidar.track.least_squares.estimated_orbit import STEPS, EstimatedOrbit
from rso_lidar.track.least_squares.fit_statistics import FitStatistics, chi_square_bounds, normalize_error
from rso_lidar.track.least_squares.gated_solution import MEASUREMENT_GATE, check_epoch, solve_gated
from rso_lidar.track.least_squares.own_state import describe_forces, format_fit_row
from rso_lidar.track.least_squares.relative_prediction import RelativeModel, RelativePrediction

_STATE, _OFFSET, _TURN = slice(0, 6), slice(6, 9), slice(9, 12)
FEWEST = 3


@dataclass(frozen=True, eq=False)
class SightBias:
    """Constant errors of all measured positions, estimated with a normal prior.

    Parameters
    ----------
    offset_m : mean (3) of centroid minus origin of the target along the line of sight (away from the lidar), across it in
        the orbital plane, and across it out of the plane [m]
    offset_sigma_m : its standard deviations (3) [m]; 0 for an offset that is known, infinite for one without a prior
    turn_sigma_rad : standard deviations (3) of a rotation about the axes of the follower's body [rad], such as a
        misalignment of the boresight; 0 for none
    """

    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset_sigma_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_sigma_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class RelativeOrbitFit:
    """Relative state of the follower and a target, estimated from a batch of measurements.

    Parameters
    ----------
    epoch_s : instant of the state, since start_utc [s]
    position_m, velocity_m_s : (3) of the follower in the rotating rtn axes of the target [m], [m/s], as in the motions
        `hill` and `nonlinear`
    covariance : (6, 6) of both, with the uncertainty of the biases and of the follower's orbit
    offset_m, offset_sigma_m : (3) estimated offset of the centroid from the target's origin [m], in the axes of `SightBias`
    turn_rad, turn_sigma_rad : (3) estimated rotation about body axes [rad]
    statistics : residuals (measurement, 3) along the line of sight, across it in the orbital plane and out of it [m],
        outliers, and chi-square
    own : orbit of the follower
    motion : model of the relative motion
    own_cross : (6, 6) covariance of the relative state (rows) with the follower's state in GCRS axes (columns)
    """

    epoch_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    covariance: np.ndarray
    offset_m: np.ndarray
    offset_sigma_m: np.ndarray
    turn_rad: np.ndarray
    turn_sigma_rad: np.ndarray
    statistics: FitStatistics
    own: EstimatedOrbit
    motion: RelativeModel
    own_cross: np.ndarray

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations (6) of position [m] and velocity [m/s]."""
        deviations: np.ndarray = np.sqrt(np.diag(self.covariance))
        return deviations

    def find_target_orbit(self) -> EstimatedOrbit:
        """Return the orbit of the target, which follows from the relative state and the follower's orbit.

        Its covariance is that of both, with their correlation: an error of the follower's position is one of the target's.

        Returns
        -------
        EstimatedOrbit
            at the epoch of the fit, under the forces of `own`
        """
        prediction = RelativePrediction(self.own, np.array([self.epoch_s]), self.motion)
        relative = np.concatenate([self.position_m, self.velocity_m_s])
        values = np.concatenate([relative, self.own.vector])

        def find(values: np.ndarray) -> np.ndarray:
            orbit = prediction.find_target(values[:6], values[6:])
            return np.concatenate([orbit.position_m, orbit.velocity_m_s])

        shifts = np.diag(np.tile(STEPS, 2))
        slopes = np.stack([(find(values + shift) - find(values - shift)) / (2.0 * shift.max()) for shift in shifts], -1)
        joint = np.block([[self.covariance, self.own_cross], [self.own_cross.T, self.own.covariance]])
        target = find(values)
        return EstimatedOrbit(
            self.own.start_utc,
            self.epoch_s,
            target[:3],
            target[3:],
            slopes @ joint @ slopes.T,
            self.own.forces,
        )

    def normalize_error(self, position_m: np.ndarray, velocity_m_s: np.ndarray) -> float:
        """Return the normalised estimation error squared (NEES), chi-square with six degrees of freedom if consistent.

        Parameters
        ----------
        position_m, velocity_m_s : (3) true relative state [m], [m/s]
        """
        error = np.concatenate([self.position_m - position_m, self.velocity_m_s - velocity_m_s])
        return normalize_error(error, self.covariance)

    def describe_error(self, position_m: np.ndarray, velocity_m_s: np.ndarray) -> list[str]:
        """Describe the error against the true state, and its NEES.

        Parameters
        ----------
        position_m, velocity_m_s : (3) true relative state [m], [m/s]

        Returns
        -------
        lines of text
        """
        low, high = chi_square_bounds(6)
        nees = self.normalize_error(position_m, velocity_m_s)
        return [
            format_fit_row("error [m]", self.position_m - position_m, "12.4f"),
            format_fit_row("error [m/s]", self.velocity_m_s - velocity_m_s, "12.6f"),
            f"NEES {nees:.2f}, 6 expected (95 % bounds {low:.2f} to {high:.2f})",
        ]

    def describe(self, target: str = "the target") -> str:
        """Describe state, standard deviations, biases and chi-square.

        Parameters
        ----------
        target : its name

        Returns
        -------
        lines of text
        """
        stats, sigma = self.statistics, self.sigma
        forces = f", {describe_forces(self.own.forces)}" if self.motion == "nonlinear" else ""
        lines = [
            f"relative orbit: {stats.n_used:,} of {len(stats.used):,} measurements, {stats.n_rejected:,} outliers; "
            f"motion {self.motion}{forces}",
            f"follower relative to {target} at {self.epoch_s:g} s in its rtn axes (radial, along, cross), with 1 sigma",
            format_fit_row("position [m]", self.position_m, "12.4f"),
            format_fit_row("   sigma [m]", sigma[:3], "12.4f"),
            format_fit_row("velocity [m/s]", self.velocity_m_s, "12.6f"),
            format_fit_row("   sigma [m/s]", sigma[3:], "12.6f"),
        ]
        if self.offset_m.any() or self.offset_sigma_m.any():
            lines.append(
                "centroid minus origin, along and across the line of sight: "
                + ", ".join(
                    f"{offset_m:.3f} ± {of:.3f}"
                    for offset_m, of in zip(self.offset_m, self.offset_sigma_m, strict=True)
                )
                + " m"
            )
        if self.turn_sigma_rad.any():
            pairs = zip(self.turn_rad / units.ARCSEC, self.turn_sigma_rad / units.ARCSEC, strict=True)
            lines.append(
                "rotation about body axes: "
                + ", ".join(f"{turn_arcsec:.1f} ± {of:.1f}" for turn_arcsec, of in pairs)
                + " arcsec"
            )
        return "\n".join([*lines, stats.describe()])


def fit_relative_state(
    time_s: np.ndarray,
    position_m: np.ndarray,
    covariance_m2: np.ndarray,
    own: EstimatedOrbit,
    *,
    epoch_s: float | None = None,
    motion: RelativeModel = "nonlinear",
    bias: SightBias = SightBias(),
    inertial_from_body: np.ndarray | None = None,
    gate: float = MEASUREMENT_GATE,
) -> RelativeOrbitFit:
    """Fit a relative orbit to measured positions of a target: ranges and lines of sight in inertial directions.

    Residuals are of range and of the line of sight. The covariance is that of Gauss and Markov. It includes the biases
    and the uncertainty of the follower's orbit (Tapley, Schutz and Born 2004, ch. 6).

    Parameters
    ----------
    time_s : (measurement) instants since `own.start_utc` [s]
    position_m : (measurement, 3) of the target minus the follower's origin in GCRS axes [m]; rows with NaN are left out
    covariance_m2 : (measurement, 3, 3) of each, independent of the others [m²]
    own : orbit of the follower
    epoch_s : instant of the estimated state [s] (None: the first measurement)
    motion : "nonlinear", "yamanaka_ankersen" or "hill"

    Other Parameters
    ----------------
    bias : constant errors to estimate
    inertial_from_body : (measurement, 3, 3) attitude of the follower, for the rotation of `bias`
    gate : probability that a measurement without fault is kept

    Returns
    -------
    RelativeOrbitFit

    Raises
    ------
    ScenarioError
        For fewer than three measurements, arrays of other shapes, an epoch more than a day from them, or measurements that
        do not determine the state
    """
    time_s, position_m, covariance_m2 = (np.asarray(each, dtype=float) for each in (time_s, position_m, covariance_m2))
    n = time_s.size
    if position_m.shape != (n, 3) or covariance_m2.shape != (n, 3, 3):
        raise ScenarioError(f"relative orbit: {n} instants need positions ({n}, 3) and covariances ({n}, 3, 3)")
    turn_sigma = np.array(bias.turn_sigma_rad)
    turns = np.zeros((0, 3, 3)) if inertial_from_body is None else np.asarray(inertial_from_body, dtype=float)
    if turn_sigma.any() and turns.shape != (n, 3, 3):
        raise ScenarioError(
            f"relative orbit: a rotation as bias needs inertial_from_body ({n}, 3, 3); give the attitude"
        )
    good = np.isfinite(position_m).all(axis=1) & np.isfinite(covariance_m2).all(axis=(1, 2)) & np.isfinite(time_s)
    if good.sum() < FEWEST:
        raise ScenarioError(f"relative orbit: needs {FEWEST} or more measurements, not {good.sum()}; give more frames")
    time_s, line, spread = time_s[good], position_m[good], covariance_m2[good]
    own = own.move_epoch(check_epoch(epoch_s, time_s, "relative orbit"))
    prediction = RelativePrediction(own, time_s, motion)
    flown = own.states(Epochs(own.start_utc, time_s))
    basis = find_sight_axes(line, flown)  # (n, 3, 3), rows along and across the line of sight
    turned = np.zeros((len(time_s), 3, 3))
    if turn_sigma.any():
        turned = -np.cross(line[:, :, None], turns[good], axis=1)
    spreads = basis @ spread @ np.swapaxes(basis, -1, -2)
    prior_sigma = np.concatenate([np.full(6, np.inf), bias.offset_sigma_m, turn_sigma])
    free = np.flatnonzero(prior_sigma > 0.0)
    start = np.concatenate([np.zeros(6), bias.offset_m, np.zeros(3)])
    start[_STATE] = _find_start(line, prediction)
    measured_m = np.linalg.norm(line, axis=1)

    def expand(values: np.ndarray) -> np.ndarray:
        full = start.copy()
        full[free] = values
        return full

    def model(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        full = expand(values)
        there = prediction.predict(full[_STATE]) + np.einsum("nji,j->ni", basis, full[_OFFSET]) + turned @ full[_TURN]
        range_m = np.linalg.norm(there, axis=1)
        toward = there / range_m[:, None]
        across = np.einsum("nij,nj->ni", basis, toward)
        residual = -measured_m[:, None] * across
        residual[:, 0] = measured_m - range_m
        slopes = measured_m[:, None, None] / range_m[:, None, None] * (basis - across[..., None] * toward[:, None, :])
        slopes[:, 0] = toward
        moved = np.concatenate([prediction.differentiate(full[_STATE]), np.swapaxes(basis, -1, -2), turned], axis=2)[
            ..., free
        ]
        return residual, slopes @ moved

    solution = solve_gated(model, start[free], spreads, prior_sigma=prior_sigma[free], gate=gate, name="relative orbit")
    values, covariance = expand(solution.values), np.zeros((12, 12))
    covariance[np.ix_(free, free)] = solution.covariance
    considered = np.zeros((12, 6))
    if own.covariance.any():
        considered[free] = solution.map_errors(basis @ prediction.differentiate_own(values[_STATE]))
        covariance += considered @ own.covariance @ considered.T
    sigma = np.sqrt(np.diag(covariance))
    return RelativeOrbitFit(
        own.epoch_s,
        values[:3],
        values[3:6],
        covariance[_STATE, _STATE],
        values[_OFFSET],
        sigma[_OFFSET],
        values[_TURN],
        sigma[_TURN],
        FitStatistics.from_solution(time_s, solution),
        own,
        motion,
        considered[_STATE] @ own.covariance,
    )


def find_sight_axes(line_m: np.ndarray, own: BodyState) -> np.ndarray:
    """Return axes (time, 3, 3), as rows in inertial axes: along lines of sight, across in the orbital plane, and out of it.

    Parameters
    ----------
    line_m : (time, 3) lines of sight [m]
    own : states (time) of the follower, whose orbital plane is meant
    """
    along = line_m / np.linalg.norm(line_m, axis=1)[:, None]
    axes = rtn_matrix(own.position_m, own.velocity_m_s)[0]
    # A line of sight along the orbit normal has no direction across it in the plane: the radial one serves there.
    steep = np.abs(np.einsum("ni,ni->n", along, axes[..., 2])) > 0.999
    pole = np.where(steep[:, None], axes[..., 0], axes[..., 2])
    across = np.cross(pole, along)
    across /= np.linalg.norm(across, axis=1)[:, None]
    return np.stack([along, across, np.cross(along, across)], axis=1)


def _find_start(line: np.ndarray, prediction: RelativePrediction) -> np.ndarray:
    """Fit a relative state (6) linearly to all lines (measurement, 3) [m], with the target's axes as the follower's."""
    slopes = prediction.differentiate(np.zeros(6))
    state: np.ndarray = np.linalg.lstsq(slopes.reshape(-1, 6), line.ravel(), rcond=None)[0]
    return state
