"""Rotation of a rigid body under the torques of sunlight and air on its facets."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr

from rso_lidar import units
from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.motion.attitudes.spin import RigidRotation
from rso_lidar.orbit import Epochs, FacetModel, OdeSolution, find_load, find_pressures_n_m2
from rso_lidar.records import FacetTable

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_GRID_S = 10.0  # between nodes of the pressures: a low orbit turns by 0.6 degrees, the penumbra takes 8 s
_BLOCK = 64  # nodes that are computed at once
_PANEL_S = 5400.0
_KEPT = 32  # flights that are remembered, the latest


class Torqued(RigidRotation):
    """Rotation of a rigid body under the torques of sunlight and air on its facets, about its centre of mass.

    Body rates and attitude hold at `start_utc`. The target must have a mesh and an orbit about the Earth. Gravity gradient,
    magnetic torques and damping are left out.
    """

    needs_orbit: ClassVar[bool] = True
    type: Literal["torqued"] = "torqued"
    facets: FacetModel = Field(default=FacetModel(), description="How sunlight and air act on the facets.")
    _find_table: Callable[[], FacetTable] | None = PrivateAttr(default=None)

    @property
    def facet_model(self) -> FacetModel:
        """Settings of sunlight and air on the facets."""
        return self.facets

    def with_table(self, find_table: Callable[[], FacetTable]) -> Self:
        """Return the attitude of a body whose facets are known.

        Parameters
        ----------
        find_table : returns the loads on the body, over directions in its body axes; it is called when they are needed
        """
        known = self.replace()
        known._find_table = find_table
        return known

    def orient(self, situation: Situation) -> Orientation:
        """Integrate the attitude; its body rates are relative to the root.

        Raises
        ------
        ScenarioError
            If the body has no mesh
        """
        if self._find_table is None:
            raise ScenarioError(
                "attitude 'torqued': needs a target with a mesh; use 'tumble' for a body free of torque"
            )
        return Orientation(*self._find_flight(situation)(situation.epochs.time_s))

    def _find_flight(self, situation: Situation) -> TorquedFlight:
        """Return the flight in an orbit, the same for all situations of one orbit."""
        assert self._find_table is not None
        table = self._find_table()
        start_utc = situation.epochs.start_utc
        motions = situation.list_motions()
        key = self.model_dump_json(), id(table), start_utc, *map(id, motions)
        with _lock:
            if key not in _flights:

                def find_pressures(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
                    epochs = Epochs(start_utc, time_s)
                    along = situation.at(epochs)
                    return find_pressures_n_m2(epochs, along.position_m, along.velocity_m_s, self.facets.atmosphere)

                _flights[key] = TorquedFlight(self, table, find_pressures), (table, motions)
                while len(_flights) > _KEPT:
                    _flights.popitem(last=False)
            _flights.move_to_end(key)
            return _flights[key][0]


# By identity of tables and motions, which are kept beside the flight so that no other object takes theirs.
_flights: OrderedDict[Any, tuple[TorquedFlight, Any]] = OrderedDict()
_lock = Lock()


class TorquedFlight:
    """The rotation of a body over time: Euler's equations with the torques of a facet table.

    Parameters
    ----------
    start : inertia, body rates and attitude at t = 0, and what acts
    table : loads on the body
    find_pressures : of times (time,) [s], the pressure of sunlight along the direction to the Sun, and the dynamic pressure
        along the velocity through the air, each (time, 3) in root axes [N/m2]
    """

    def __init__(
        self,
        start: Torqued,
        table: FacetTable,
        find_pressures: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    ) -> None:
        inertia = start.inertia_tensor_kg_m2
        inverse = np.linalg.inv(inertia)
        acts = np.array([float(start.facets.sunlight), float(start.facets.drag)])[:, None]
        self._find_pressures, self._acts = find_pressures, acts
        self._blocks: dict[int, np.ndarray] = {}

        def derivative(time_s: float, state: np.ndarray) -> np.ndarray:
            x, y, z, w = (state[:4] / math.sqrt(state[:4] @ state[:4])).tolist()
            rate = state[4:]
            a, b, c = rate.tolist()
            root_from_body = np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                ]
            )
            light, air = self.find_pressures_n_m2(time_s) @ root_from_body
            torque = find_load(table, light, air)[1]
            turned = [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
            change = inverse @ (torque - np.cross(rate, inertia @ rate))
            return np.concatenate([0.5 * np.array(turned), change])

        rate = np.array(start.body_rate_deg_s, dtype=float) * units.DEG
        first = np.array(start.quaternion_xyzw, dtype=float)
        # 1e-13 of the rate, and of a revolution a day, in each step
        least = 1e-13 * max(float(np.linalg.norm(rate)), 7.3e-5)
        self._solution = OdeSolution(
            derivative,
            np.concatenate([first / np.linalg.norm(first), rate]),
            panel_s=_PANEL_S,
            rtol=1e-12,
            atol=np.array([1e-13] * 4 + [least] * 3),
            name="torqued",
        )

    def __call__(self, time_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Return root_from_body (time) and the body rates (time, 3) [rad/s] at times (time,) [s]."""
        from scipy.spatial.transform import Rotation

        states = self._solution(time_s)
        return Rotation.from_quat(states[:, :4]), states[:, 4:]

    def find_pressures_n_m2(self, time_s: float) -> np.ndarray:
        """Return the pressures that act, of sunlight and of air (2, 3) [N/m2] in root axes, linear between nodes.

        Parameters
        ----------
        time_s : instant [s]
        """
        number, within = divmod(time_s / _GRID_S, _BLOCK)
        block = self._blocks.get(int(number))
        if block is None:
            nodes = _GRID_S * (number * _BLOCK + np.arange(_BLOCK + 1))
            try:
                block = self._blocks[int(number)] = np.stack(self._find_pressures(nodes), axis=1) * self._acts
            except RsoLidarError:  # the orbit ends within the block
                rows = np.stack(self._find_pressures(np.array([time_s])), axis=1) * self._acts
                return np.asarray(rows[0])
        row = min(int(within), _BLOCK - 1)
        share = within - row
        pressures: np.ndarray = (1.0 - share) * block[row] + share * block[row + 1]
        return pressures
