"""Outputs of an FMU at the points of its grid, computed once and read at any instant."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.fmi import FmuModel
from rso_lidar.part import Positive

_MOST_STEPS = 10_000_000
_BLOCK = 256  # steps at least that are computed at once


class PrescribedFmu(FmuModel):
    """Base of motions and attitudes that an FMU without inputs computes as functions of time."""

    step_s: Positive = Field(
        description="Grid of the FMU from `start_utc` on [s]; between its points values are interpolated."
    )

    def history(self) -> FmuHistory:
        """Return the outputs of the FMU over time, which all that ask for the same FMU share."""
        status = Path(self.file).stat()
        return _find_history(self.model_dump_json(), type(self), (status.st_mtime_ns, status.st_size))


class FmuHistory:
    """Outputs of an FMU on its grid, extended as later instants are asked for.

    Parameters
    ----------
    model : the FMU.
    """

    def __init__(self, model: PrescribedFmu) -> None:
        self._step_s, self._run = model.step_s, model.make_run(model.step_s)
        self._point, first = self._run.begin(np.empty(0))
        self._rows = first[None]

    def around(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the outputs at the points of the grid before and after instants.

        Parameters
        ----------
        time_s : instants (time,) from 0 [s].

        Returns
        -------
        outputs before and after (time, output), and the share of the step that has passed (time,).

        Raises
        ------
        ScenarioError
            If the FMU fails, or an instant is before 0 or too many steps away.
        """
        place = np.asarray(time_s, dtype=float) / self._step_s
        if place.size and place.min() < -1e-9:
            raise ScenarioError(
                f"{self._run.name}: an FMU begins at t = 0, and {place.min() * self._step_s:g} s was asked for"
            )
        place = np.maximum(place, 0.0)
        nearest = np.rint(place)
        place = np.where(np.abs(place - nearest) < 1e-6, nearest, place)  # rounding of times that are on the grid
        low = np.floor(place).astype(int)
        last = int(low.max()) + 1 if low.size else 0
        if last > _MOST_STEPS:
            raise ScenarioError(f"{self._run.name}: {last:,} steps of {self._step_s:g} s are too many; raise step_s")
        missing = last + 1 - len(self._rows)
        if missing > 0:
            held = np.empty((max(missing, min(_BLOCK, len(self._rows))), 0))
            self._point, outputs = self._run.advance(self._point, held, keep_state=False)
            self._rows = np.concatenate([self._rows, outputs])
        return self._rows[low], self._rows[low + 1], place - low


@functools.lru_cache(maxsize=16)
def _find_history(dump: str, kind: type[PrescribedFmu], _stamp: tuple[int, int]) -> FmuHistory:
    """Return the history of an FMU, cached until its file changes.

    Parameters
    ----------
    dump : the part as JSON.
    kind : class of the part.
    _stamp : modification time and size of the file, a key of the cache.
    """
    return FmuHistory(kind.model_validate_json(dump))


def interpolate_cubic(
    before: np.ndarray, after: np.ndarray, rates: tuple[np.ndarray, np.ndarray], share: np.ndarray, step_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate values and their rates by cubic Hermite polynomials.

    Parameters
    ----------
    before, after : values (time, n) at the ends of a step.
    rates : their rates there.
    share : of the step that has passed (time,).
    step_s : length of the step [s].

    Returns
    -------
    values and rates (time, n).
    """
    s = share[:, None]
    first, last = rates[0] * step_s, rates[1] * step_s
    change = after - before
    values = before + s * (first + s * (3.0 * change - 2.0 * first - last + s * (first + last - 2.0 * change)))
    slopes = first + s * (2.0 * (3.0 * change - 2.0 * first - last) + 3.0 * s * (first + last - 2.0 * change))
    return values, slopes / step_s
