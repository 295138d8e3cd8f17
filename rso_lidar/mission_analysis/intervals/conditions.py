"""What the words of an expression mean: their functions of two objects, and whom they are about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.mission_analysis.budgets.pixel_light import pixel_width_m
from rso_lidar.mission_analysis.intervals.exhaust import PlanExhaust
from rso_lidar.mission_analysis.intervals.expression import Condition, intersect_spans, parse_quantity
from rso_lidar.mission_analysis.intervals.found_table import tabulate_found
from rso_lidar.mission_analysis.intervals.pointing import FollowerPointing
from rso_lidar.mission_analysis.passes.exclusion import keep_out_radius_m, select_rtn_corridors
from rso_lidar.mission_analysis.passes.plate_light import PlateLight
from rso_lidar.orbit import (
    LIMB_ANGLE_RAD,
    LINE_ALTITUDE_M,
    MOON_ANGLE_RAD,
    PHASE_RAD,
    RANGE_M,
    SLEW_RAD_S,
    SPEED_M_S,
    SUN_ANGLE_RAD,
    Epochs,
    GroundStation,
    MotionBounds,
    PairCondition,
    PairQuantity,
    PairSamples,
    ScheduledFleet,
    elevation_rad,
    find_bounded_spans,
    join_spans,
    rtn_angle_rad,
    sun_height_rad,
)
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo import rtn_matrix
from rso_lidar.scenario import Constraints

# Kind of the unit of each quantity, and None for what holds or does not.
WORDS: dict[str, str | None] = {
    "range": "length",
    "speed": "speed",
    "slew": "turning",
    "sun": "angle",
    "moon": "angle",
    "limb": "angle",
    "phase": "angle",
    "angle": "angle",
    "elevation": "angle",
    "pixels": "number",
    "found": "number",
    "visible": None,
    "sunlit": None,
    "penumbra": None,
    "umbra": None,
    "lit": None,
    "contact": None,
    "field": None,
    "beam": None,
    "regard": None,
    "keep_out": None,
    "corridor": None,
    "plume": None,
}
_RTN = {"r": (1.0, 0.0, 0.0), "t": (0.0, 1.0, 0.0), "n": (0.0, 0.0, 1.0)}
_BODY = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_WHO = ("follower", "target")
LIT_PHASE_RAD = 0.5 * np.pi  # phase up to which sunlight is on the lidar's side

_QUANTITIES: Mapping[str, PairQuantity] = {
    "range": RANGE_M,
    "speed": SPEED_M_S,
    "slew": SLEW_RAD_S,
    "sun": SUN_ANGLE_RAD,
    "moon": MOON_ANGLE_RAD,
    "limb": LIMB_ANGLE_RAD,
    "phase": PHASE_RAD,
}


@dataclass(frozen=True, eq=False)
class EventContext:
    """What conditions need to know beyond the two orbits.

    Parameters
    ----------
    light : lidar, viewed plate and finding
    constraints : keep-out sphere and corridors; None for none
    stations : on the ground, by name
    pointing : of a scenario's follower; None where the follower has no attitude
    exhaust : of a scenario's body that is the follower; None for other objects, and where no condition asks
    """

    light: PlateLight
    constraints: Constraints | None
    stations: Mapping[str, GroundStation]
    pointing: FollowerPointing | None
    exhaust: PlanExhaust | None = None


class EventSearch:
    """The conditions of expressions, searched for one pair of objects after another.

    Parameters
    ----------
    flights : the objects
    instrument : lidar, stations and constraints
    """

    def __init__(self, flights: ScheduledFleet, instrument: EventContext) -> None:
        self._flights, self._instrument = flights, instrument

    def locate(self, number: int, time_s: np.ndarray) -> BodyState:
        """Return the states (time, 3) of an object in GCRS axes at times [s]."""
        return self._flights.states_in_gcrs(np.full(len(time_s), number), self.epochs(time_s))

    def epochs(self, time_s: np.ndarray) -> Epochs:
        """Return epochs at times [s]."""
        return Epochs(self._flights.start_utc, time_s)

    def sample(self, follower: int, target: int, time_s: np.ndarray) -> PairSamples:
        """Return two objects at times [s]."""
        return PairSamples(self.epochs(time_s), self.locate(follower, time_s), self.locate(target, time_s))

    def find(
        self, condition: Condition, windows: Sequence[tuple[float, float]], follower: int, target: int
    ) -> list[tuple[float, float]]:
        """Find the spans within windows in which a condition on a follower and a target holds [s]."""
        if condition.word == "lit":
            parts = Condition("sunlit"), Condition("phase", (), True, LIT_PHASE_RAD)
            for part in parts:
                windows = self.find(part, windows, follower, target)
            return list(windows)
        if condition.word == "plume":
            exhaust, half_angle_rad, range_m = self._find_exhaust(condition.arguments)
            spans = exhaust.find(lambda time_s: self.sample(follower, target, time_s), windows, half_angle_rad, range_m)
            return intersect_spans(windows, join_spans(spans, 0.0))
        station, who = self._find_station(condition)
        wanted = self.make_margin(condition, station, who)

        def states(time_s: np.ndarray) -> PairSamples:
            if station is None:
                return self.sample(follower, target, time_s)
            at = self.epochs(time_s)
            return PairSamples(at, station.states(at), self.locate(target if who == "target" else follower, time_s))

        return find_bounded_spans(PairCondition(states, wanted), windows)

    def make_margin(self, condition: Condition, station: GroundStation | None, who: str) -> PairQuantity:
        """Make the function that is negative where a condition holds.

        Parameters
        ----------
        station : that it is about, which is then the observer; None for none
        who : follower or target, whom it is about
        """
        quantity = self._find_quantity(condition, station)
        if quantity is not None:
            return quantity.less_than(condition.limit) if condition.is_below else quantity.more_than(condition.limit)
        word, of_target = condition.word, who == "target"
        if word == "visible":
            return LINE_ALTITUDE_M.more_than(0.0)
        if station is not None:
            return elevation_rad(station).more_than(station.least_elevation_deg * units.DEG)
        if word in ("sunlit", "penumbra", "umbra"):
            part = {"sunlit": "half", "penumbra": "touched", "umbra": "covered"}[word]
            height = sun_height_rad(of_target, part)
            return height.more_than(0.0) if word == "sunlit" else height.less_than(0.0)
        if word in ("keep_out", "corridor"):
            return _make_constraint(word, self._instrument.constraints)
        pointing = self._need_pointing(word)
        if word == "regard":
            return pointing.travel()
        lidar = self._instrument.light.lidar
        if word == "field":
            return pointing.field(lidar.receiver.field_edge.tolist())
        half = lidar.laser.half_width_tangent
        return pointing.field((half, half), is_round=lidar.laser.footprint in ("circle", "gaussian"))

    def _find_quantity(self, condition: Condition, station: GroundStation | None) -> PairQuantity | None:
        word, light = condition.word, self._instrument.light
        if word in _QUANTITIES:
            return _QUANTITIES[word]
        if word == "elevation" and station is not None:
            return elevation_rad(station)
        if word == "angle":
            return self._find_axis_angle(condition.arguments)
        if word == "pixels":
            return _count_pixels_across(light)
        return self._found if word == "found" else None

    @cached_property
    def _found(self) -> PairQuantity:
        return tabulate_found(self._instrument.light)

    def _find_axis_angle(self, arguments: Sequence[str]) -> PairQuantity:
        """Return the angle of the line of sight from an axis that is named: of rtn, of the body, or the boresight."""
        name = arguments[0]
        if name == "boresight":
            return self._need_pointing("angle(boresight)").boresight_angle_rad()
        sign, letter = (-1.0 if name.startswith("-") else 1.0), name.lstrip("+-")
        if letter in _RTN:
            return rtn_angle_rad([sign * part for part in _RTN[letter]])
        return self._need_pointing(f"angle({name})").axis_angle_rad([sign * part for part in _BODY[letter]])

    def _need_pointing(self, word: str) -> FollowerPointing:
        if self._instrument.pointing is None:
            raise ScenarioError(
                f"when: {word} needs the attitude of a scenario's follower, and this follower has an orbit alone; write a "
                "cone in its rtn axes, such as angle(+t) < 60deg, or give the scenario as --follower"
            )
        return self._instrument.pointing

    def _find_exhaust(self, arguments: Sequence[str]) -> tuple[PlanExhaust, float, float]:
        """Return the exhaust, its half angle [rad] and its range [m], as given or as limited by the plan."""
        exhaust = self._instrument.exhaust
        if exhaust is None:
            raise ScenarioError("when: plume needs a follower that flies a plan; give its scenario as --follower")
        if not arguments and exhaust.half_angle_deg is not None and exhaust.range_m is not None:
            return exhaust, exhaust.half_angle_deg * units.DEG, exhaust.range_m
        kinds = ("angle", "length")
        given = [parse_quantity(text, kind) for text, kind in zip(arguments, kinds, strict=False)]
        if len(arguments) == 2 and all(given) and min(given) > 0.0 and given[0] < np.pi:  # type: ignore[type-var,operator]
            return exhaust, *given  # type: ignore[return-value]
        written = f"plume({', '.join(arguments)})" if arguments else "plume"
        raise ScenarioError(
            f"when: {written}: needs the half angle of the exhaust, below 180deg, and its range; write plume(30deg, 200m)"
            + ("" if arguments else ", or give the sequence plume_half_angle_deg and plume_range_m")
        )

    def check(self, condition: Condition) -> None:
        """Raise `ScenarioError` for arguments that a condition does not take, and for what is not known."""
        word, arguments = condition.word, condition.arguments
        if word == "angle":
            known = ["boresight", *(sign + letter for letter in (*_RTN, *_BODY) for sign in "+-")]
            if len(arguments) != 1 or arguments[0] not in known:
                given = f"({', '.join(arguments)})" if arguments else ""
                raise ScenarioError(f"when: angle{given}: needs one axis; give one of {', '.join(known)}")
        elif word in ("sunlit", "penumbra", "umbra"):
            self._check_who(word, arguments)
        elif word == "plume":
            self._find_exhaust(arguments)
        elif word not in ("contact", "elevation") and arguments:
            raise ScenarioError(f"when: {word} takes no arguments; leave ({', '.join(arguments)}) out")
        if word not in ("lit", "plume"):
            self.make_margin(condition, *self._find_station(condition))

    def _check_who(self, word: str, who: Sequence[str]) -> None:
        if len(who) > 1 or (who and who[0] not in _WHO):
            raise ScenarioError(f"when: {word}({', '.join(who)}): is about {' or '.join(_WHO)}; name one, or none")

    def _find_station(self, condition: Condition) -> tuple[GroundStation | None, str]:
        """Return the station that a condition names, if any, and whom the condition is about."""
        word, arguments = condition.word, condition.arguments
        if word not in ("contact", "elevation"):
            return None, arguments[0] if arguments else "target"
        stations = self._instrument.stations
        if not arguments or arguments[0] not in stations:
            name = arguments[0] if arguments else ""
            known = f"(known: {', '.join(stations)})" if stations else "(no station is given: --station NAME=LAT,LON)"
            guess = did_you_mean(name, stations)
            raise ScenarioError(f"when: {word}({name}): needs the name of a station{guess or ';'} {known}")
        self._check_who(word, arguments[1:])
        return stations[arguments[0]], arguments[1] if len(arguments) > 1 else "follower"


def _count_pixels_across(light: PlateLight) -> PairQuantity:
    """Return the pixels that the side of the plate covers, from its range."""
    receiver, side_m = light.lidar.receiver, light.plate.values[0]

    def value(pair: PairSamples) -> np.ndarray:
        return side_m / pixel_width_m(receiver, np.maximum(pair.range_m, 1e-3))

    def rate(bounds: MotionBounds) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            least = np.maximum(bounds.least_range_m, 1e-3)
            rate: np.ndarray = side_m / pixel_width_m(receiver, least) * bounds.range_rate_m_s / least
        return rate

    return PairQuantity(value, rate)


def _make_constraint(word: str, constraints: Constraints | None) -> PairQuantity:
    """Make the margin [m] of the keep-out sphere outside of corridors, or of the corridors: negative inside."""
    radius_m, corridors = keep_out_radius_m(constraints), select_rtn_corridors(constraints)
    if (radius_m is None) if word == "keep_out" else not corridors:
        needs = "a radius; give --keep-out" if word == "keep_out" else 'a corridor in axes "rtn"; write one'
        raise ScenarioError(f"when: {word} needs {needs}, or a scenario as --lidar whose [constraints] have it")

    def inside_m(pair: PairSamples) -> np.ndarray:
        rtn_from_inertial = np.swapaxes(rtn_matrix(pair.target.position_m, pair.target.velocity_m_s)[0], -1, -2)
        place_m = rotate_vectors(rtn_from_inertial, -pair.line_m)
        margins = [corridor.margin_m(place_m) for corridor in corridors]
        return np.max(margins, axis=0) if margins else np.full(len(place_m), -np.inf)

    def value(pair: PairSamples) -> np.ndarray:
        if word == "corridor":
            return -inside_m(pair)
        intrusion: np.ndarray = np.maximum(pair.range_m - (radius_m or 0.0), inside_m(pair))
        return intrusion

    def rate(bounds: MotionBounds) -> np.ndarray:
        aside = bounds.speed_m_s + bounds.greatest_range_m * bounds.target_turning_rad_s
        return np.pi * bounds.speed_m_s + aside if corridors else bounds.range_rate_m_s

    return PairQuantity(value, rate)


def find_windows(flights: ScheduledFleet, follower: int, target: int, duration_s: float) -> list[tuple[float, float]]:
    """Return the windows [s] in which two objects have states, each without a switch of an element set or of a piece."""
    spans = []
    for number in (follower, target):
        mine = np.flatnonzero(flights.owner == number)
        ends = zip(np.maximum(flights.from_s[mine], 0.0), np.minimum(flights.to_s[mine], duration_s), strict=True)
        spans.append([(float(begin), float(end)) for begin, end in ends if end > begin])
    both = [(max(begin, first), min(end, last)) for begin, end in spans[0] for first, last in spans[1]]
    return [(begin, end) for begin, end in both if end > begin]
