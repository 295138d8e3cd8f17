"""Geometry of single passes: light, background, and the time in which range, slew and exclusion angles allow a look."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector import find_photons
from rso_lidar.mission_analysis.budgets.pixel_light import filled_pixel_photons
from rso_lidar.mission_analysis.passes.exclusion import TOGETHER_M, ExclusionAngles, check_constraints
from rso_lidar.mission_analysis.passes.pass_collision import PassCollision
from rso_lidar.mission_analysis.passes.plate_light import REFLECTANCE, PlateLight, tabulate_light
from rso_lidar.orbit import (
    CloseApproach,
    Epochs,
    PairScreening,
    ScreeningResult,
    angle_rad,
    beta_angle_rad,
    earth_limb_angle_rad,
    format_utc,
    moon_position_m,
    phase_angle_rad,
    sun_position_m,
    sunlit_fraction,
)
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo import rtn_matrix
from rso_lidar.scenario import Constraints, Lidar

PLATE_M2 = 1.0  # one square metre
SMALL_M2 = 0.01  # a side of a 1U CubeSat
_EACH_SIDE = 100  # epochs before and after the closest approach, on each of two grids
_APART_S = 60.0  # greatest step: in a formation the line of sight turns once per orbit
_AT_ONCE = 400_000  # epochs of encounters in one batch


@dataclass(frozen=True)
class Encounter:
    """One pass of an object within the distance limit. Values without a span hold at the closest approach.

    `elements` and `follower` are the element sets in use at the closest approach, or the pieces of trajectories.
    `follower_name` and `follower_norad_id` name the object that carries the lidar: of a pair, the first one.

    `minima` counts the minima of range in the pass; the least one is the closest approach. `switches` counts changes of
    either object to another of its element sets, where the range jumps. `entered` and `left` are False where the searched
    span begins or ends inside the pass.

    `phase_deg` is the angle at the object between Sun and follower (0: the Sun is behind the follower). `sun_angle_deg`,
    `moon_angle_deg` and `earth_limb_deg` are angles from the line of sight to the Sun, the Moon and the Earth's limb
    (negative: the Earth is behind the object). `beta_deg` is the Sun's elevation over the follower's orbit plane.
    `slew_deg_s` and `turning_deg_s2` are rate and acceleration of the line of sight in inertial axes.
    `peak_turning_deg_s2` is the greatest acceleration in the pass.

    `lidar_s` is the time within the lidar's reach, and `slew_s` that within the slew limit. `clear_s` is the time in which
    a boresight at the object keeps all exclusion angles. `usable_s` is the time within all three limits (to about 1 %).

    `photons` are those of the brightest pixel, and `target_pixels` the pixels covered, of an assumed plate (`ViewedPlate`).
    `background_photons_per_s` is sunlight on it. `detection_probability` is that of one flash at the closest approach, and
    `best_probability` the greatest in the stay. `found_probability` is that it is found at all in the stay.

    `docked` explains why the two count as docked or as one object, and is empty where they do not. Each `…_kept` states
    whether a constraint is kept, None where it is not asked or does not apply. `corridor_angle_deg` is the angle at the
    object between a corridor's axis and the follower, in the object's rtn axes.

    `collision` is the probability of collision with what was used for it, None where nobody asked and for docked craft.
    """

    name: str
    norad_id: int
    follower_name: str
    follower_norad_id: int
    closest_utc: str
    range_m: float
    speed_m_s: float
    from_utc: str
    to_utc: str
    inside_s: float
    entered: bool
    left: bool
    minima: int
    switches: int
    age_days: float
    follower_age_days: float
    sunlit_fraction: float
    follower_sunlit_fraction: float
    phase_deg: float
    sun_angle_deg: float
    moon_angle_deg: float
    earth_limb_deg: float
    beta_deg: float
    slew_deg_s: float
    turning_deg_s2: float
    peak_turning_deg_s2: float
    lidar_s: float
    slew_s: float
    clear_s: float
    usable_s: float
    photons: float
    target_pixels: float
    background_photons_per_s: float
    detection_probability: float
    best_probability: float
    found_probability: float
    sun_kept: bool | None
    moon_kept: bool | None
    earth_kept: bool | None
    keep_out_kept: bool | None
    corridor_kept: bool | None
    corridor_angle_deg: float | None
    docked: str
    time_s: float = field(metadata={"private": True})
    span_s: tuple[float, float] = field(metadata={"private": True})
    stay: CloseApproach = field(repr=False, compare=False, metadata={"private": True})
    elements: Any = field(repr=False, compare=False, metadata={"private": True})
    follower: Any = field(repr=False, compare=False, metadata={"private": True})
    states: tuple[BodyState, BodyState] = field(repr=False, compare=False, metadata={"private": True})
    collision: PassCollision | None = field(default=None, metadata={"private": True})

    @property
    def label(self) -> str:
        """Name of the object, or its catalogue number where it has none."""
        return self.name or f"NORAD {self.norad_id}"

    @property
    def follower_label(self) -> str:
        """Name of the object with the lidar, or its catalogue number where it has no name."""
        return self.follower_name or f"NORAD {self.follower_norad_id}"

    def closest_at(self, start_utc: datetime.datetime) -> datetime.datetime:
        """Return the instant of the closest approach, to a microsecond.

        Parameters
        ----------
        start_utc : begin of the search
        """
        return start_utc.astimezone(datetime.UTC) + datetime.timedelta(seconds=self.time_s)

    @property
    def breaks(self) -> tuple[str, ...]:
        """Names of the constraints that are violated at the closest approach."""
        kept = (self.sun_kept, self.moon_kept, self.earth_kept, self.keep_out_kept, self.corridor_kept)
        names = ("Sun", "Moon", "Earth", "keep-out", "corridor")
        return tuple(name for name, held in zip(names, kept, strict=True) if held is False)

    @classmethod
    def columns(cls) -> list[str]:
        """Return the names of the columns of a table; those with a unit end in it."""
        return [entry.name for entry in fields(cls) if not entry.metadata.get("private")]


def reach_m(lidar: Lidar, plate_m2: float = PLATE_M2) -> tuple[float, float]:
    """Return the nearest and the farthest range [m] at which a lidar sees a facing Lambertian plate of reflectance 0.30.

    The nearest range is that of the detector. The farthest is the detector's too, or the range at which one pixel detects
    the plate's light in half of all flashes, with the laser's own pulse. Beyond the range where the pixel is larger than the
    plate, only the plate's share of the pixel counts.

    Parameters
    ----------
    lidar : the instrument
    plate_m2 : area of the plate [m²]

    Returns
    -------
    tuple of float
        Nearest and farthest range [m].
    """
    detector, laser, receiver = lidar.detector.traits, lidar.laser, lidar.receiver
    half = find_photons(lidar.detector, lidar.pulse, np.array([0.5]))
    needed = detector.threshold_photons if half is None else float(half[0])
    at_1_m = filled_pixel_photons(laser, receiver, REFLECTANCE / math.pi, 1.0) / needed
    filled = math.sqrt(at_1_m)
    alone = math.sqrt(plate_m2) / receiver.pixel_tangent  # beyond this the pixel is larger than the plate
    far = filled if filled <= alone else math.sqrt(filled * alone)
    return float(detector.sees_from_m), float(min(detector.sees_to_m, far))


def build_encounters(
    screened: ScreeningResult | PairScreening,
    reach: tuple[float, float],
    max_slew_deg_s: float,
    light: PlateLight,
    constraints: Constraints | None = None,
) -> list[Encounter]:
    """Build one encounter for each close approach of a screening, in its order.

    Parameters
    ----------
    reach : nearest and farthest range of the lidar [m]
    max_slew_deg_s : greatest rate of the line of sight [deg/s]
    """
    sky = ExclusionAngles(screened, constraints)
    each = [max(_EACH_SIDE, math.ceil((stay.leave_s - stay.enter_s) / _APART_S)) for stay in screened.approaches]
    each = [2 ** math.ceil(math.log2(number / _EACH_SIDE)) * _EACH_SIDE for number in each]
    rows: list[Encounter | None] = [None] * len(each)
    for number in sorted(set(each)):
        alike = [k for k, of in enumerate(each) if of == number]
        lot = max(1, _AT_ONCE // (4 * number))
        for begin in range(0, len(alike), lot):
            some = alike[begin : begin + lot]
            stays = tuple(screened.approaches[k] for k in some)
            for k, row in zip(
                some, _build_batch(screened, stays, reach, max_slew_deg_s, light, sky, number), strict=True
            ):
                rows[k] = row
    return [row for row in rows if row is not None]


def _build_batch(
    screened: ScreeningResult | PairScreening,
    stays: tuple[CloseApproach, ...],
    reach: tuple[float, float],
    max_slew_deg_s: float,
    light: PlateLight,
    sky: ExclusionAngles,
    each_side: int,
) -> list[Encounter]:
    """Build the encounters of some close approaches."""
    lead, objects = screened.follower, screened.objects
    which, first = (np.array(numbers) for numbers in zip(*((stay.which, stay.lead) for stay in stays), strict=True))
    time_s = np.array([stay.time_s for stay in stays])
    range_m = np.array([stay.range_m for stay in stays])
    epochs = Epochs(objects.start_utc, time_s)
    target, own = objects.states_in_gcrs(which, epochs), lead.states_in_gcrs(first, epochs)
    line = target.position_m - own.position_m
    sun, moon = sun_position_m(epochs), moon_position_m(epochs)
    speed = np.linalg.norm(target.velocity_m_s - own.velocity_m_s, axis=1)
    table: dict[str, np.ndarray] = {
        "range_m": range_m,
        "speed_m_s": speed,
        "age_days": objects.ages_days(which, time_s),
        "follower_age_days": lead.ages_days(first, time_s),
        "sunlit_fraction": sunlit_fraction(target.position_m, sun),
        "follower_sunlit_fraction": sunlit_fraction(own.position_m, sun),
        "phase_deg": phase_angle_rad(target.position_m, own.position_m, sun) / units.DEG,
        "sun_angle_deg": angle_rad(line, sun - own.position_m) / units.DEG,
        "moon_angle_deg": angle_rad(line, moon - own.position_m) / units.DEG,
        "earth_limb_deg": earth_limb_angle_rad(line, own.position_m) / units.DEG,
        "beta_deg": beta_angle_rad(own, sun) / units.DEG,
        "time_s": time_s,
    }
    for name in ("phase_deg", "sun_angle_deg", "moon_angle_deg", "earth_limb_deg"):
        table[name][range_m < TOGETHER_M] = np.nan  # docked craft have the same elements: there is no line of sight
    looked, spans = _integrate_stays(screened, stays, speed, reach, max_slew_deg_s, light, sky, each_side)
    table |= looked
    place_m = rotate_vectors(np.swapaxes(rtn_matrix(target.position_m, target.velocity_m_s)[0], -1, -2), -line)
    kept = check_constraints(sky.constraints, table, place_m)
    rows = []
    for k, stay in enumerate(stays):
        elements, follower = objects.elements(stay.which, stay.time_s), lead.elements(stay.lead, stay.time_s)
        values: dict[str, Any] = {name: float(column[k]) for name, column in table.items()}
        values |= {name: held[k] for name, held in kept.items()}
        within = stay.enter_s, stay.leave_s
        rows.append(
            Encounter(
                name=elements.name,
                norad_id=elements.norad_id,
                follower_name=follower.name,
                follower_norad_id=follower.norad_id,
                closest_utc=format_utc(objects.start_utc, stay.time_s),
                from_utc=format_utc(objects.start_utc, stay.enter_s),
                to_utc=format_utc(objects.start_utc, stay.leave_s),
                inside_s=stay.leave_s - stay.enter_s,
                entered=stay.entered,
                left=stay.left,
                minima=len(stay.minima_s),
                switches=objects.switches(stay.which, *within) + lead.switches(stay.lead, *within),
                docked="",
                span_s=spans[k],
                stay=stay,
                elements=elements,
                follower=follower,
                states=(_select_state(own, k), _select_state(target, k)),
                **values,
            )
        )
    return rows


def _select_state(states: BodyState, row: int) -> BodyState:
    return BodyState(states.position_m[row], states.velocity_m_s[row])


def _integrate_stays(
    screened: ScreeningResult | PairScreening,
    stays: tuple[CloseApproach, ...],
    speed_m_s: np.ndarray,
    reach: tuple[float, float],
    max_slew_deg_s: float,
    light: PlateLight,
    sky: ExclusionAngles,
    each_side: int,
) -> tuple[dict[str, np.ndarray], list[tuple[float, float]]]:
    """Compute what depends on the whole stay, and the span [s] of reach about the closest approach (NaN: never in reach).

    Times are dense about the closest approach, where the line of sight turns fastest, on the scale of range over speed.

    Parameters
    ----------
    speed_m_s : (stay) relative speed at the closest approach [m/s]
    """
    nearest = np.array([stay.time_s for stay in stays])
    range_m = np.array([stay.range_m for stay in stays])
    scale = np.clip(range_m / np.maximum(speed_m_s, 1e-6), 1e-3, 1e5)[:, None]
    u = np.linspace(0.0, 1.0, each_side + 1)[1:]
    sides = []
    for end, sign in ((nearest - [stay.enter_s for stay in stays], -1.0), ([s.leave_s for s in stays] - nearest, 1.0)):
        length = np.maximum(end, 0.0)[:, None]
        sides += [sign * scale * np.sinh(u * np.arcsinh(length / scale)), sign * length * u]
    offset = np.sort(np.concatenate([*sides, np.zeros((len(stays), 1))], axis=1), axis=1)
    time_s = nearest[:, None] + offset
    shape = time_s.shape
    which = np.repeat([stay.which for stay in stays], shape[1])
    objects, lead = screened.objects, screened.follower
    own = np.repeat([stay.lead for stay in stays], shape[1])
    there, here = objects.at(which, time_s.ravel()), lead.at(own, time_s.ravel())
    line, rate = ((a - b).reshape(*shape, 3) for a, b in zip(there, here, strict=True))
    square = np.maximum(np.einsum("nti,nti->nt", line, line), 1e-6)
    turning = np.cross(line, rate) / square[..., None]  # rate of the line of sight [rad/s]
    slew = np.sqrt(np.einsum("nti,nti->nt", turning, turning))
    step = np.diff(time_s, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.diff(turning, axis=1) / step[..., None]
    sets = objects.number(which, time_s.ravel()) + lead.number(own, time_s.ravel())  # both numbers never decrease
    smooth = (step > 1e-6) & (np.diff(sets.reshape(shape), axis=1) == 0)  # no acceleration across a jump between sets
    change = np.where(smooth[..., None], change, 0.0)
    acceleration = np.sqrt(np.einsum("nti,nti->nt", change, change))
    middle = np.argmin(np.abs(offset), axis=1)
    each = np.arange(len(stays))
    beside = np.clip(np.stack([middle - 1, middle]), 0, step.shape[1] - 1)
    apart = np.sqrt(square)
    too_far = np.maximum(apart / reach[1], reach[0] / np.maximum(apart, 1e-3)) - 1.0
    too_fast = slew / (max_slew_deg_s * units.DEG) - 1.0
    place = here[0].reshape(line.shape)
    excluded = sky.compute_excess_rad(time_s, line, place)
    columns = tabulate_light(light, sky, time_s, (line, rate, place), (too_fast <= 0.0) & (excluded <= 0.0), middle)
    spans = []
    for k in range(len(stays)):
        out = np.flatnonzero(too_far[k] > 0.0)
        first = int(out[out < middle[k]].max(initial=-1)) + 1  # the epochs in reach about the closest approach
        last = int(out[out > middle[k]].min(initial=shape[1])) - 1
        never = bool(too_far[k, middle[k]] > 0.0)
        spans.append((math.nan, math.nan) if never else (float(time_s[k, first]), float(time_s[k, last])))
    return {
        "slew_deg_s": slew[each, middle] / units.DEG,
        "turning_deg_s2": np.mean([acceleration[each, row] for row in beside], axis=0) / units.DEG,
        "peak_turning_deg_s2": acceleration.max(axis=1) / units.DEG,
        "lidar_s": _time_below(too_far, step),
        "slew_s": _time_below(too_fast, step),
        "clear_s": _time_below(excluded, step),
        "usable_s": _time_below(np.maximum(np.maximum(too_far, too_fast), excluded), step),
        **columns,
    }, spans


def _time_below(value: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """Return the time (row) [s] in which values (row, instant), interpolated linearly, are zero or less."""
    low, high = np.minimum(value[:, :-1], value[:, 1:]), np.maximum(value[:, :-1], value[:, 1:])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(high <= 0.0, 1.0, np.where(low > 0.0, 0.0, -low / (high - low)))
    total: np.ndarray = np.sum(share * step_s, axis=1)
    return total
