"""The navigation filters of dispersed runs at the nodes of the flight: what they measure there, and in which light."""

from __future__ import annotations

import numpy as np

from rso_lidar.orbit import Epochs
from rso_lidar.rpo import DeviationFlow, FilterBank, RelativeFilter, ScalarUpdate, find_clear_views
from rso_lidar.study.dispersions.nominal_flight import NominalFlight

PER_SENSOR = 3  # standard normal numbers of a measurement


class FilterNodes:
    """Where the filters of a dispersed flight measure.

    Parameters
    ----------
    part : the filter
    flight : the flight without random errors
    node_s : (node,) instants of the nodes [s]
    """

    def __init__(self, part: RelativeFilter, flight: NominalFlight, node_s: np.ndarray) -> None:
        assert flight.chief_m is not None
        self.part = part
        instants = part.list_instants_s(0.0, float(node_s[-1]))
        nodes = np.minimum(np.searchsorted(node_s, instants - DeviationFlow.TIE_S), len(node_s) - 1)
        chief, craft = flight.chief_m(node_s[nodes]), flight.craft_m(node_s[nodes])
        clear = find_clear_views(part.sensors, Epochs(flight.start_utc, node_s[nodes]), chief, craft)
        self._reference = dict(zip(nodes.tolist(), craft - chief, strict=True))
        self._clear = dict(zip(nodes.tolist(), clear, strict=True))

    def __contains__(self, node: int) -> bool:
        return node in self._clear

    @property
    def per_instant(self) -> int:
        """How many standard normal numbers the measurements of an instant take."""
        return PER_SENSOR * len(self.part.sensors)

    def observe(self, bank: FilterBank, node: int, state: np.ndarray, numbers: np.ndarray) -> list[ScalarUpdate]:
        """Measure with all sensors that can, and update the filters.

        Parameters
        ----------
        bank : the filters
        node : at which they measure
        state : (6, run) true deviations, inertial axes
        numbers : (number, run) standard normal
        """
        reference = self._reference[node][:, None]
        true_m = reference + state[:3]
        updates: list[ScalarUpdate] = []
        for k, sensor in enumerate(self.part.sensors):
            if self._clear[node][k]:
                own = numbers[PER_SENSOR * k : PER_SENSOR * (k + 1)]
                updates += bank.observe(sensor, reference, true_m, own)
        return updates
