"""An orbit from solutions of GNSS: batch least squares with the errors that the receiver's model states."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Forces, propagate_two_body
from rso_lidar.track.least_squares.estimated_orbit import EstimatedOrbit, find_transition, propagate_state
from rso_lidar.track.least_squares.fit_statistics import FitStatistics
from rso_lidar.track.least_squares.gated_solution import MEASUREMENT_GATE, check_epoch, solve_gated

MOST_SOLUTIONS = 1000  # of more, an even selection: their covariance is a dense matrix
_LEAST = (1e-3, 1e-6)  # assumed sigma of a receiver without stated errors [m], [m/s]: a floor that keeps weights finite


@dataclass(frozen=True)
class GnssErrors:
    """Errors of solutions of GNSS, each 1 sigma of an axis: white noise, and slow errors (Gauss-Markov processes).

    Along the local vertical they are `vertical_ratio` times as large.
    """

    position_m: float
    velocity_m_s: float
    slow_position_m: float = 0.0
    slow_velocity_m_s: float = 0.0
    correlation_s: float = 300.0
    vertical_ratio: float = 1.0

    def covariance(self, time_s: np.ndarray, kind: int) -> np.ndarray:
        """Return the covariance (time, time) of one horizontal axis of position (kind 0) or velocity (kind 1).

        Parameters
        ----------
        time_s : (time) instants [s]
        kind : 0 or 1
        """
        white = max((self.position_m, self.velocity_m_s)[kind], _LEAST[kind])
        slow = (self.slow_position_m, self.slow_velocity_m_s)[kind]
        apart_s = np.abs(np.subtract.outer(time_s, time_s))
        matrix: np.ndarray = slow**2 * np.exp(-apart_s / self.correlation_s)
        matrix[np.diag_indices(len(time_s))] += white**2
        return matrix


@dataclass(frozen=True, eq=False)
class OwnOrbitFit:
    """The follower's orbit from GNSS.

    Parameters
    ----------
    orbit : estimated state with its covariance, and its forces
    statistics : residuals (solution, 6) of position [m] and velocity [m/s] in GCRS axes, outliers and chi-square
    n_solutions : valid solutions that were given; of more than 1,000, an even selection is fitted
    """

    orbit: EstimatedOrbit
    statistics: FitStatistics
    n_solutions: int

    def describe(self) -> str:
        """Describe state, standard deviations and chi-square."""
        orbit, stats = self.orbit, self.statistics
        sigma = np.sqrt(np.diag(orbit.covariance))
        selected = f", selected evenly of {self.n_solutions:,}" if self.n_solutions > len(stats.used) else ""
        return "\n".join(
            [
                f"own orbit: {stats.n_used:,} of {len(stats.used):,} solutions of GNSS{selected}, "
                f"{stats.n_rejected:,} outliers; {describe_forces(orbit.forces)}",
                f"state at {orbit.epoch_s:g} s in GCRS axes, with 1 sigma",
                format_fit_row("position [km]", orbit.position_m / units.KM, "14.6f"),
                format_fit_row("     sigma [m]", sigma[:3], "14.4f"),
                format_fit_row("velocity [m/s]", orbit.velocity_m_s, "14.5f"),
                format_fit_row("   sigma [m/s]", sigma[3:], "14.6f"),
                stats.describe(),
            ]
        )


def fit_own_state(
    time_s: np.ndarray,
    position_m: np.ndarray,
    velocity_m_s: np.ndarray,
    errors: GnssErrors,
    *,
    start_utc: datetime.datetime,
    epoch_s: float | None = None,
    forces: Forces | None = Forces(),  # noqa: B008 - frozen
    gate: float = MEASUREMENT_GATE,
) -> OwnOrbitFit:
    """Fit an orbit to solutions of GNSS.

    The covariance includes the correlation of slow errors. It does not include forces that are left out.

    Parameters
    ----------
    time_s : (solution) instants since `start_utc` [s]
    position_m, velocity_m_s : (solution, 3) in GCRS axes [m], [m/s]; rows with NaN are left out
    errors : of the receiver
    start_utc : start of the run
    epoch_s : instant of the estimated state [s] (None: the first solution)

    Other Parameters
    ----------------
    forces : on the body besides the central attraction; None for two-body motion
    gate : probability that a solution without fault is kept

    Returns
    -------
    OwnOrbitFit

    Raises
    ------
    ScenarioError
        For fewer than three solutions, arrays of other shapes, or an epoch more than a day from them
    """
    from scipy.linalg import solve_triangular

    time_s, position_m, velocity_m_s = (np.asarray(each, dtype=float) for each in (time_s, position_m, velocity_m_s))
    n = time_s.size
    if position_m.shape != (n, 3) or velocity_m_s.shape != (n, 3):
        raise ScenarioError(f"own orbit: {n} instants need positions and velocities ({n}, 3)")
    rows = np.concatenate([position_m, velocity_m_s], axis=1)
    good = np.flatnonzero(np.isfinite(rows).all(axis=1) & np.isfinite(time_s))
    if len(good) < 3:
        raise ScenarioError(f"own orbit: needs 3 or more valid solutions of GNSS, not {len(good)}; record more")
    n_solutions = len(good)
    if n_solutions > MOST_SOLUTIONS:
        good = good[np.linspace(0, len(good) - 1, MOST_SOLUTIONS).round().astype(int)]
    time_s, rows = time_s[good], rows[good]
    at_s = check_epoch(epoch_s, time_s, "own orbit")
    up = rows[:, :3] / np.linalg.norm(rows[:, :3], axis=1)[:, None]
    outer = np.einsum("ni,nj->nij", up, up)
    even = np.eye(3) + (1.0 / errors.vertical_ratio - 1.0) * outer  # equal errors along all axes
    marginal = np.zeros((len(time_s), 6, 6))
    stretch = np.eye(3) + (errors.vertical_ratio**2 - 1.0) * outer
    for kind in (0, 1):
        part = slice(3 * kind, 3 * kind + 3)
        marginal[:, part, part] = errors.covariance(np.zeros(1), kind)[0, 0] * stretch

    factors: dict[bytes, list[np.ndarray]] = {}

    def whiten(values: np.ndarray, used: np.ndarray) -> np.ndarray:
        key = used.tobytes()
        if key not in factors:
            factors.clear()
            lower = (np.linalg.cholesky(errors.covariance(time_s[used], kind)) for kind in (0, 1))
            factors[key] = [solve_triangular(each, np.eye(int(used.sum())), lower=True) for each in lower]
        white = []
        for kind, factor in enumerate(factors[key]):
            turned = even[used] @ values[used, 3 * kind : 3 * kind + 3]
            white.append(factor @ turned.reshape(len(turned), -1))
        return np.concatenate([block.reshape(-1, values.shape[-1]) for block in white])

    def model(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        there = propagate_state(vector, time_s, at_s, start_utc, forces)
        predicted = np.concatenate([there.position_m, there.velocity_m_s], axis=1)
        return rows - predicted, find_transition(vector, time_s - at_s)

    start = _find_start(time_s, rows, at_s)
    solution = solve_gated(model, start, marginal, whitening=whiten, gate=gate, name="own orbit")
    orbit = EstimatedOrbit(start_utc, at_s, solution.values[:3], solution.values[3:], solution.covariance, forces)
    return OwnOrbitFit(orbit, FitStatistics.from_solution(time_s, solution), n_solutions)


def _find_start(time_s: np.ndarray, rows: np.ndarray, at_s: float) -> np.ndarray:
    """Return the median (6) of some solutions, each propagated to an epoch by two-body motion.

    Parameters
    ----------
    time_s, rows : solutions (solution), (solution, 6)
    at_s : epoch [s]
    """
    some = np.unique(np.linspace(0, len(rows) - 1, min(9, len(rows))).round().astype(int))
    states = [
        np.concatenate(propagate_two_body(rows[k, :3], rows[k, 3:], np.array([at_s - time_s[k]])), axis=1)[0]
        for k in some
    ]
    middle: np.ndarray = np.median(states, axis=0)
    return middle


def describe_forces(forces: Forces | None) -> str:
    """Describe the forces on a body in a few words."""
    words = [(forces and forces.describe_gravity()) or "two-body motion"]
    others = [name.replace("_", " ") for name in ("drag", "radiation_pressure", "sun", "moon")
              if forces is not None and getattr(forces, name)]  # fmt: skip
    return "forces: " + ", ".join([*words, *others])


def format_fit_row(head: str, values: np.ndarray, form: str) -> str:
    """Format a row of the table of a fit: a heading, padded to 16 characters, and numbers."""
    return f"{head:<16}" + "  ".join(f"{value:{form}}" for value in values)
