"""A drive of a pan-tilt unit that a Functional Mock-up Unit computes."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.fmi import FmuModel, find_conversion
from rso_lidar.motion.gimbal.drive import TICK_S, Pair, State, Travel
from rso_lidar.part import Text


class FmuDrive(FmuModel, Travel):
    """A drive as an FMU (FMI 2 or 3) on the grid of 1 ms: demanded pan and tilt in, pan and tilt out.

    Quantities of `inputs`: `pan_rad` and `tilt_rad`, the demand, which is held over each millisecond. Of `outputs`:
    `pan_rad`, `tilt_rad` and, if the FMU has them, `pan_rate_rad_s` and `tilt_rate_rad_s`. Otherwise the rates are the
    changes over the last millisecond. `start_variables` names variables that receive the first demand as start values.
    Between two milliseconds an angle goes on at its rate. The travel limits demand and result.
    """

    preview_limit_s: ClassVar[float] = 60.0
    input_units: ClassVar[dict[str, tuple[str, int]]] = {"pan_rad": ("rad", 1), "tilt_rad": ("rad", 1)}
    output_units: ClassVar[dict[str, tuple[str, int]]] = {
        "pan_rad": ("rad", 1),
        "tilt_rad": ("rad", 1),
        "pan_rate_rad_s": ("rad/s", 1),
        "tilt_rate_rad_s": ("rad/s", 1),
    }
    optional_names: ClassVar[frozenset[str]] = frozenset({"pan_rate_rad_s", "tilt_rate_rad_s"})

    type: Literal["fmu"] = "fmu"
    start_variables: dict[str, Text] = Field(
        default={}, description="Variables whose start values are the first demanded `pan_rad` and `tilt_rad`."
    )

    def begin(self, pan_rad: float, tilt_rad: float) -> State:
        """Start the FMU at t = 0.

        Parameters
        ----------
        pan_rad, tilt_rad : first demand [rad]

        Returns
        -------
        (angle [rad], rate [rad/s]) of pan and of tilt, and the point of the run

        Raises
        ------
        ScenarioError
            If the FMU cannot be run, or its mapping is wrong
        """
        run = self.make_run(TICK_S)
        variables, start = run.description["variables"], []
        for quantity, name in self.start_variables.items():
            if quantity not in self.input_units:
                raise ScenarioError(f"start_variables: no quantity '{quantity}'; known: pan_rad, tilt_rad")
            if name not in variables:
                raise ScenarioError(f"{run.name}: the FMU has no variable '{name}'{did_you_mean(name, variables)}")
            declared = variables[name]["unit"]
            where = f"{run.name}: '{name}'"
            to_si = find_conversion(where, declared, self.units.get(name), run.description["units"], "rad")
            value = pan_rad if quantity == "pan_rad" else tilt_rad
            start.append((name, (value - to_si.offset) / to_si.factor))
        point, outputs = run.begin(np.array([pan_rad, tilt_rad]), tuple(start))
        rates = self._rates(outputs[None], np.zeros(2))
        return self._limit(outputs[:2], rates if len(outputs) == 4 else np.zeros(2)), (point,)

    def advance(
        self, begin_s: float, dt: float, axes: tuple[Pair, Pair], further: tuple[Any, ...], held: np.ndarray
    ) -> State:
        """Advance both axes through demands that are held one after the other.

        Parameters
        ----------
        begin_s, dt, axes, held : as for `StateSpaceDrive.advance`
        further : the point of the run at `begin_s`

        Returns
        -------
        (angle [rad], rate [rad/s]) of pan and of tilt after the last row, and the point of the run there
        """
        if dt < TICK_S:
            (pan, pan_rate), (tilt, tilt_rate) = axes
            return self._limit(
                np.array([pan + dt * pan_rate, tilt + dt * tilt_rate]), np.array([pan_rate, tilt_rate])
            ), further
        (point,) = further
        after, outputs = point.run.advance(point, held)
        before = np.array([axes[0][0], axes[1][0]])
        return self._limit(outputs[-1, :2], self._rates(outputs, before)), (after,)

    def _rates(self, outputs: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the rates (2,) after the last row of outputs: those of the FMU, or the last change.

        Parameters
        ----------
        outputs : (tick, output)
        before : angles before the first row [rad]
        """
        stated = [name for name in self.output_units if name in self.outputs][2:]
        last = outputs[-2, :2] if len(outputs) > 1 else before
        rates: np.ndarray = (outputs[-1, :2] - last) / TICK_S
        for column, name in enumerate(stated, start=2):
            rates[("pan_rate_rad_s", "tilt_rate_rad_s").index(name)] = outputs[-1, column]
        return rates

    def _limit(self, angles: np.ndarray, rates: np.ndarray) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return (angle, rate) of both axes within the travel."""
        axes = []
        for angle, rate, (low, high) in zip(angles.tolist(), rates.tolist(), self.travel_rad, strict=True):
            within = min(max(angle, low), high)
            axes.append((within, rate if within == angle else 0.0))
        return axes[0], axes[1]
