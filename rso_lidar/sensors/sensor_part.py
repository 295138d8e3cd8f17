"""What all described sensors have: a name, the schedule of their samples, outages, and random errors."""

from __future__ import annotations

import math
import tomllib
from abc import abstractmethod
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.part import Name, NotNegative, Part, Positive, Text
from rso_lidar.records import BodyMotion, MotionQuantity, SensorState
from rso_lidar.sensors.random_errors import ErrorModel, ErrorProcess, draw_errors, make_model

_MAX_RATE_HZ = 1e5
_DECADE = 10.0
_MOST_PROCESSES = 8
_MOST_LISTED = 3

ErrorTerms = tuple[tuple[str, str, str], ...]  # as `check` prints them: what it is, its field, its unit


class OutageWindow(Part):
    """A span of time in which a sensor gives no valid samples."""

    from_s: NotNegative = Field(description="Start of the outage, since `start_utc` [s].")
    to_s: Positive = Field(description="End of the outage, since `start_utc` [s]; a sample at this instant is valid.")

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        if self.to_s <= self.from_s:
            raise ValueError(f"to_s ({self.to_s:g}) must be after from_s ({self.from_s:g})")
        return self


class RandomOutage(Part):
    """Outages at random: a Markov chain of two states with exponentially distributed durations."""

    mean_up_s: Positive = Field(description="Mean duration between outages [s].")
    mean_down_s: Positive = Field(description="Mean duration of an outage [s].")


class Impairment(NamedTuple):
    """What keeps a sensor from its stated performance: when (time) bool, what it is, why, and what to do about it."""

    when: np.ndarray
    what: str
    why: str
    cure: str


class SensorPart(Part):
    """Base of described sensors. Sample n holds at `phase_s` + n / `rate_hz` and is available `latency_s` later."""

    _ERRORS: ClassVar[ErrorTerms] = ()

    name: Name = Field(description="Name of the sensor; its random numbers depend on the name and on the seed.")
    preset: Text | None = Field(
        default=None,
        description="Name of a shipped sensor, whose values apply where none are given here (docs/sensors.md).",
    )
    rate_hz: Annotated[Positive, Field(le=_MAX_RATE_HZ)] = Field(description="Rate of the samples [Hz].")
    phase_s: NotNegative = Field(default=0.0, description="Instant of sample 0, since `start_utc` [s].")
    latency_s: NotNegative = Field(
        default=0.0, description="Delay from the instant of a sample until flight software receives it [s]."
    )
    outages: tuple[OutageWindow, ...] = Field(default=(), description="Spans of time without valid samples.")
    random_outage: RandomOutage | None = Field(
        default=None, description="Outages at random, beside `outages`. If omitted, there are none."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, given: Any) -> Any:
        kind = cls.model_fields["type"].default if "type" in cls.model_fields else None
        return _merge_preset(kind, given) if isinstance(given, dict) else given

    @property
    def reads(self) -> frozenset[str]:
        """What the sensor reads of the follower's motion, beside its angular velocity and specific force."""
        return frozenset(MotionQuantity)

    @property
    def look_back(self) -> int:
        """Number of earlier samples on whose true motion a sample depends. Its random errors need none."""
        return 0

    @property
    @abstractmethod
    def quantity(self) -> str:
        """Words for what the sensor measures."""

    def describe_errors(self) -> str:
        """Describe the stated errors and limits, in the units of their fields."""
        stated = [(what, getattr(self, field), unit) for what, field, unit in self._ERRORS]
        texts = [f"{what} {value:g}{'' if unit == '°' else ' '}{unit}" for what, value, unit in stated if value]
        return ", ".join(texts) or "no errors stated"

    def describe_outages(self) -> str:
        """Describe the outages; nothing without any."""
        spans = [f"{outage.from_s:g} to {outage.to_s:g} s" for outage in self.outages]
        if len(spans) > _MOST_LISTED:
            spans = [*spans[: _MOST_LISTED - 1], f"{len(spans) - _MOST_LISTED + 1} more"]
        if self.random_outage is not None:
            means = self.random_outage
            spans.append(f"at random, {means.mean_down_s:g} s after {means.mean_up_s:g} s (means)")
        return f"outages {', '.join(spans)}" if spans else ""

    def find_impairments(self, motion: BodyMotion) -> list[Impairment]:
        """Find what keeps the sensor from its stated performance along a motion, apart from its outages.

        Parameters
        ----------
        motion : true motion of the follower

        Returns
        -------
        one for each kind of impairment
        """
        return []

    @abstractmethod
    def _list_errors(self) -> tuple[np.ndarray, list[ErrorProcess]]:
        """Return the standard deviations of the white noise (channel), and the processes, of this kind of sensor."""

    @cached_property
    def error_model(self) -> ErrorModel:
        """Random errors of the sensor, for its sampling interval."""
        white, processes = self._list_errors()
        return make_model(white, processes, self._outage_probabilities)

    @property
    def _outage_probabilities(self) -> tuple[float, float, float]:
        """Probabilities to be out: after a sample that is out, after one that is not, and at sample 0."""
        if self.random_outage is None:
            return 0.0, 0.0, 0.0
        up, down = self.random_outage.mean_up_s, self.random_outage.mean_down_s
        share = down / (up + down)
        memory = math.exp(-(1.0 / up + 1.0 / down) / self.rate_hz)
        return share + (1.0 - share) * memory, share * (1.0 - memory), share

    def draw(
        self, key: np.ndarray, first_sample: int, time_s: np.ndarray, state: SensorState | None
    ) -> tuple[np.ndarray, np.ndarray, SensorState]:
        """Draw the random errors of successive samples, and find those that are not in an outage.

        Parameters
        ----------
        key : (2) uint32, of the sensor (`make_key`)
        first_sample : number of the first sample
        time_s : (sample) instants of the samples [s]
        state : after an earlier sample; None before all. Samples between are skipped over

        Returns
        -------
        errors (sample, channel), whether each sample is outside of outages (sample) bool, and the state after them

        Raises
        ------
        ScenarioError
            If the state is later than the first sample
        """
        model, count = self.error_model, len(time_s)
        values = np.zeros(model.n_values) if state is None else np.array(state.values)
        begin = 0 if state is None else state.next_sample
        if begin > first_sample or len(values) != model.n_values:
            raise ScenarioError(
                f"sensor '{self.name}': the state before sample {begin} does not serve sample {first_sample}; "
                "give the state of this sensor after an earlier sample, or None"
            )
        errors, out = np.empty((count, len(model.white))), np.empty(count, np.bool_)
        if count:
            arrays = (model.white, model.process, model.channel, model.n_driven, model.outage)
            draw_errors(key, begin, first_sample - begin, *arrays, values, errors, out)
            begin = first_sample + count
        valid = ~out
        for window in self.outages:
            valid &= (time_s < window.from_s) | (time_s >= window.to_s)
        return errors, valid, SensorState(begin, values)


def gauss_markov(channels: tuple[int, ...], sigma: float, correlation_s: float, step_s: float) -> ErrorProcess:
    """Return a Gauss-Markov process of first order, discretised exactly, that starts in its stationary distribution."""
    decay = math.exp(-step_s / correlation_s)
    return ErrorProcess(channels, decay, sigma * math.sqrt(-math.expm1(-2.0 * step_s / correlation_s)), sigma)


def flicker(
    channels: tuple[int, ...], floor: float, correlation_s: tuple[float, float], step_s: float
) -> list[ErrorProcess]:
    """Return Gauss-Markov processes whose sum has a flat Allan deviation, as flicker noise has (Keshner 1982).

    There is one process for each decade of the correlation time, all of one variance. The greatest Allan deviation of the
    sum is `floor`.
    """
    shortest, longest = correlation_s
    count = 1 + round(math.log(longest / shortest, _DECADE))
    times = np.geomspace(shortest, longest, count)
    # One process has its greatest Allan deviation at 1.89 correlation times (IEEE Std 952, annex C), well inside this grid.
    averaging_s = np.geomspace(0.1 * shortest, 100.0 * longest, 1000)
    greatest = float(np.max(sum(gauss_markov_allan_variance(averaging_s, 1.0, float(it)) for it in times)))
    sigma = floor / math.sqrt(greatest)
    return [gauss_markov(channels, sigma, float(it), step_s) for it in times]


def gauss_markov_allan_variance(averaging_s: np.ndarray, sigma: float, correlation_s: float) -> np.ndarray:
    """Return the Allan variance (…) of a Gauss-Markov process of first order (IEEE Std 952, annex C)."""
    x = averaging_s / correlation_s
    # 2 s2 / x (1 - (3 - 4 exp(-x) + exp(-2 x)) / (2 x)), by expm1 so that short times lose no digits
    short, double = np.expm1(-x), np.expm1(-2.0 * x)
    variance: np.ndarray = 2.0 * sigma**2 / x * (1.0 - (double - 4.0 * short) / (2.0 * x))
    return variance


def check_correlation(times_s: tuple[float, float]) -> tuple[float, float]:
    """Check the range of correlation times of flicker noise, and return it."""
    shortest, longest = times_s
    if not shortest <= longest <= shortest * _DECADE ** (_MOST_PROCESSES - 1):
        raise ValueError(
            f"needs the shortest and the longest time, at most {_MOST_PROCESSES - 1} decades apart, not "
            f"({shortest:g}, {longest:g})"
        )
    return times_s


@cache
def load_sensor_presets() -> dict[str, dict[str, Any]]:
    """Load the shipped sensors by name, as TOML tables of `[[sensor]]` with a line `what`."""
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))


def _merge_preset(kind: str | None, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a table with the values of its preset where it has none; without a preset, the table itself."""
    name = given.get("preset")
    if not isinstance(name, str):
        return given
    known = {each: table for each, table in load_sensor_presets().items() if table["type"] == kind}
    if name not in known:
        raise ValueError(f"preset: no {kind} '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})")
    return {key: value for key, value in known[name].items() if key != "what"} | dict(given)
