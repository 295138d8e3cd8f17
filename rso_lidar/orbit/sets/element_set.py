"""One element set: the mean elements of one object at one epoch, with the fields of an OMM (CCSDS 502.0-B-3).

The OMM is the native record, because five-digit catalogue numbers have run out. A TLE keeps its two lines beside the
fields, and is propagated from them. The sgp4 library's own reader of OMM stops at catalogue number 339999 and rejects
an epoch without a fraction, so `sgp4init` is called here. The number passed to it is a dummy; ours stays exact.
"""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rso_lidar import units
from rso_lidar.errors import join_problems, make_printable, quote_value

NO_EPOCH = datetime.datetime(1, 1, 1, tzinfo=datetime.UTC)  # epoch of a record too damaged to have one
REQUIRED = (
    "NORAD_CAT_ID",
    "EPOCH",
    "MEAN_MOTION",
    "ECCENTRICITY",
    "INCLINATION",
    "RA_OF_ASC_NODE",
    "ARG_OF_PERICENTER",
    "MEAN_ANOMALY",
    "BSTAR",
)
KEYS = (
    "OBJECT_NAME",
    "OBJECT_ID",
    "EPOCH",
    "MEAN_MOTION",
    "ECCENTRICITY",
    "INCLINATION",
    "RA_OF_ASC_NODE",
    "ARG_OF_PERICENTER",
    "MEAN_ANOMALY",
    "EPHEMERIS_TYPE",
    "CLASSIFICATION_TYPE",
    "NORAD_CAT_ID",
    "ELEMENT_SET_NO",
    "REV_AT_EPOCH",
    "BSTAR",
    "MEAN_MOTION_DOT",
    "MEAN_MOTION_DDOT",
)  # in CelesTrak's order
# The only values that SGP4 allows where a message states these keys.
_ONLY = {
    "CENTER_NAME": ("EARTH",),
    "REF_FRAME": ("TEME",),
    "TIME_SYSTEM": ("UTC",),
    "MEAN_ELEMENT_THEORY": ("SGP4", "SGP/SGP4", "SGP4/SDP4", "SDP4"),
}
KNOWN = frozenset(KEYS) | frozenset(_ONLY) | {"BTERM"}  # the last is the ballistic term of SGP4-XP
# Limits of mean motion about the Earth by Kepler's third law, with a margin: 0.0047 rev/day on its Hill sphere (1.5 million
# km), 17.04 rev/day at its equatorial radius.
SLOWEST_REV_DAY, FASTEST_REV_DAY = 0.004, 18.0
SGP4_XP = 4  # ephemeris type of another theory; SGP4 would propagate such a set with errors of kilometres
_EPOCH = re.compile(
    r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))[T ](\d\d):(\d\d):(\d\d)(?:\.(\d*))?(Z|[+-]00:?00)?", re.ASCII | re.IGNORECASE
)


@dataclass(frozen=True)
class ElementSet:
    """One element set as it was written: the mean elements of SGP4 at one epoch.

    Texts from any source are made printable: a name is one line. Rates are as TLE and OMM print them; SGP4 uses
    neither. What a bad record does not contain is NaN, 0 or `NO_EPOCH`.

    Parameters
    ----------
    name : name of the object, which may be empty
    norad_id : catalogue number, 0 for an object without one
    line1, line2 : the two lines of a TLE, empty for an OMM
    where : file and line, or record, for messages
    problem : what is wrong with the record, None for a good one
    object_id : international designator, such as 1998-067A
    epoch_utc : epoch, truncated to whole microseconds
    epoch_rest_ns : rest of the epoch [ns]
    mean_motion_rev_day : Kozai mean motion [rev/day]
    eccentricity, inclination_deg, raan_deg, argument_of_perigee_deg, mean_anomaly_deg : mean elements in TEME axes
    bstar_per_earth_radius : drag term B* [1/Earth radius]
    mean_motion_dot_rev_day2 : half of the rate of mean motion [rev/day^2]
    mean_motion_ddot_rev_day3 : a sixth of the second derivative of mean motion [rev/day^3]
    ephemeris_type, classification, element_set_no, rev_at_epoch : bookkeeping of the publisher
    """

    name: str
    norad_id: int
    line1: str = ""
    line2: str = ""
    where: str = ""
    problem: str | None = None
    object_id: str = ""
    epoch_utc: datetime.datetime = NO_EPOCH
    epoch_rest_ns: float = 0.0
    mean_motion_rev_day: float = math.nan
    eccentricity: float = math.nan
    inclination_deg: float = math.nan
    raan_deg: float = math.nan
    argument_of_perigee_deg: float = math.nan
    mean_anomaly_deg: float = math.nan
    bstar_per_earth_radius: float = math.nan
    mean_motion_dot_rev_day2: float = 0.0
    mean_motion_ddot_rev_day3: float = 0.0
    ephemeris_type: int = 0
    classification: str = "U"
    element_set_no: int = 0
    rev_at_epoch: int = 0

    def __post_init__(self) -> None:
        for key in ("name", "object_id", "classification", "problem"):
            text = getattr(self, key)
            if text and not text.isprintable():
                object.__setattr__(self, key, make_printable(text))

    @property
    def label(self) -> str:
        """Name of the object, if it has one, and its catalogue number."""
        return f"{self.name} (NORAD {self.norad_id})" if self.name else f"NORAD {self.norad_id}"

    @property
    def identity(self) -> tuple[int, str]:
        """What identifies the object: its catalogue number, or its name where it has no number yet."""
        return (self.norad_id, "" if self.norad_id else self.name.casefold())

    @property
    def kind(self) -> str:
        """Notation of the source: "tle" or "omm"."""
        return "tle" if self.line1 else "omm"

    @property
    def regime(self) -> str:
        """Orbital regime as Space-Track divides its catalogue: "leo", "meo", "geo", "heo" or "other".

        leo: more than 11.25 rev/day and e below 0.25. meo: a period of 600 to 800 min and e below 0.25. geo: 0.99 to
        1.01 rev/day and e below 0.01. heo: e of 0.25 and more. Source: www.space-track.org, basic space data, orbital
        regimes.
        """
        turns, e = self.mean_motion_rev_day, self.eccentricity
        if e >= 0.25:
            return "heo"
        if turns > 11.25:
            return "leo"
        if 600.0 <= 1440.0 / turns <= 800.0:
            return "meo"
        return "geo" if 0.99 <= turns <= 1.01 and e < 0.01 else "other"

    def satrec(self) -> Any:
        """Make a new sgp4 Satrec (WGS72), from the lines of a TLE or else from the elements.

        It is a new one on each call, because the deep-space integrator keeps its state in it and threads must not share
        that.

        Returns
        -------
        the Satrec, initialised
        """
        from sgp4.api import WGS72, Satrec

        if self.line1:
            return Satrec.twoline2rv(self.line1, self.line2)
        midnight = self.epoch_utc.replace(hour=0, minute=0, second=0, microsecond=0)
        days_1950 = (midnight - datetime.datetime(1949, 12, 31, tzinfo=datetime.UTC)).days
        in_day = self.epoch_utc - midnight
        fraction = (in_day / datetime.timedelta(microseconds=1) * 1e-6 + self.epoch_rest_ns * units.NS) / units.DAY_S
        # sgp4init takes radians and minutes; the factors and their order are those of Vallado's twoline2rv, for equal bits.
        per_minute = 1440.0 / (2.0 * math.pi)
        model = Satrec()
        model.sgp4init(
            WGS72,
            "i",
            0,
            days_1950 + fraction,
            self.bstar_per_earth_radius,
            self.mean_motion_dot_rev_day2 / (per_minute * 1440.0),
            self.mean_motion_ddot_rev_day3 / (per_minute * 1440.0 * 1440.0),
            self.eccentricity,
            self.argument_of_perigee_deg * units.DEG,
            self.inclination_deg * units.DEG,
            self.mean_anomaly_deg * units.DEG,
            self.mean_motion_rev_day / per_minute,
            self.raan_deg * units.DEG,
        )
        # sgp4init splits a sum that is 0.3 us coarse, 2 mm along a low orbit; SGP4 counts time from these two.
        model.jdsatepoch, model.jdsatepochF = days_1950 + 2_433_281.5, fraction
        return model

    def omm(self) -> dict[str, str | int | float]:
        """Return the fields of an OMM, as CelesTrak spells them."""
        nanoseconds = f"{self.epoch_utc.microsecond:06d}" + (
            f"{self.epoch_rest_ns:03.0f}" if 0.5 <= self.epoch_rest_ns < 999.5 else ""
        )
        values: tuple[str | int | float, ...] = (
            self.name,
            self.object_id,
            f"{self.epoch_utc:%Y-%m-%dT%H:%M:%S}.{nanoseconds}",
            self.mean_motion_rev_day,
            self.eccentricity,
            self.inclination_deg,
            self.raan_deg,
            self.argument_of_perigee_deg,
            self.mean_anomaly_deg,
            self.ephemeris_type,
            self.classification,
            self.norad_id,
            self.element_set_no,
            self.rev_at_epoch,
            self.bstar_per_earth_radius,
            self.mean_motion_dot_rev_day2,
            self.mean_motion_ddot_rev_day3,
        )
        return dict(zip(KEYS, values, strict=True))


def element_set_from_omm(fields: Mapping[str, Any], where: str, problem: str | None = None) -> ElementSet:
    """Make the element set of an OMM's fields.

    Returns
    -------
    ElementSet
        its `problem` states what is wrong with the fields
    """
    wrong: list[str] = [problem] if problem else []

    def text(key: str) -> str:
        value = fields.get(key)
        return "" if value is None else str(value).strip()

    def number(key: str, otherwise: float = math.nan) -> float:
        value = fields.get(key)
        if value is None or value == "":
            return otherwise
        if type(value) is float and math.isfinite(value):
            return value
        parsed = _parse_number(value)
        if parsed is None:
            wrong.append(f"{key} {quote_value(value)} is not a number")
        return math.nan if parsed is None else parsed

    def whole(key: str, most: int = 10**9) -> int:
        value = number(key, 0.0)
        if value != value or not 0 <= value < most or value != int(value):
            wrong.append(
                f"{key} {quote_value(fields.get(key))} is not a whole number of at most {len(str(most - 1))} digits"
            )
            return 0
        return int(value)

    for key, allowed in _ONLY.items():
        if key in fields and text(key) and text(key).upper() not in allowed:
            wrong.append(f"{key} is {quote_value(fields[key])}, which SGP4 cannot propagate: it needs {allowed[0]}")
    is_foreign = any(what.startswith("MEAN_ELEMENT_THEORY") for what in wrong)
    has_type = text("EPHEMERIS_TYPE") == str(SGP4_XP)
    if not is_foreign and (has_type or (text("BTERM") and not text("BSTAR"))):
        is_foreign = True
        sign = f"ephemeris type {SGP4_XP}" if has_type else "BTERM in place of BSTAR"
        wrong.append(f"is for SGP4-XP ({sign}), another theory than SGP4")
    missing = [key for key in REQUIRED if text(key) == "" and not (key == "BSTAR" and is_foreign)]
    if missing:
        wrong.append(f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing")
    epoch, rest_ns = NO_EPOCH, 0.0
    if text("EPOCH"):
        try:
            epoch, rest_ns = parse_epoch(text("EPOCH"))
        except ValueError as error:
            wrong.append(str(error))
    element_set = ElementSet(
        name=text("OBJECT_NAME"),
        norad_id=whole("NORAD_CAT_ID"),
        where=where,
        object_id=text("OBJECT_ID"),
        epoch_utc=epoch,
        epoch_rest_ns=rest_ns,
        mean_motion_rev_day=number("MEAN_MOTION"),
        eccentricity=number("ECCENTRICITY"),
        inclination_deg=number("INCLINATION"),
        raan_deg=number("RA_OF_ASC_NODE"),
        argument_of_perigee_deg=number("ARG_OF_PERICENTER"),
        mean_anomaly_deg=number("MEAN_ANOMALY"),
        bstar_per_earth_radius=number("BSTAR"),
        mean_motion_dot_rev_day2=number("MEAN_MOTION_DOT", 0.0),
        mean_motion_ddot_rev_day3=number("MEAN_MOTION_DDOT", 0.0),
        ephemeris_type=whole("EPHEMERIS_TYPE"),
        classification=text("CLASSIFICATION_TYPE") or "U",
        element_set_no=whole("ELEMENT_SET_NO"),
        rev_at_epoch=whole("REV_AT_EPOCH"),
    )
    if not wrong and (out := explain_impossible(element_set)):
        wrong.append(out)
    if wrong:
        cure = "fetch elements of SGP4" if is_foreign else "correct the record, or fetch it again"
        message = f"{where}: {join_problems(wrong)}; {cure}"
        element_set = ElementSet(**{**element_set.__dict__, "problem": message})
    return element_set


def explain_impossible(elements: ElementSet) -> str | None:
    """Explain in words why numbers cannot be elements of an orbit about the Earth; None if they can."""
    if not 0.0 <= elements.eccentricity < 1.0:
        return f"eccentricity {elements.eccentricity:g} is not from 0 to below 1"
    if not elements.mean_motion_rev_day > 0.0:
        return f"mean motion {elements.mean_motion_rev_day:g} rev/day is not above 0"
    if not SLOWEST_REV_DAY <= elements.mean_motion_rev_day <= FASTEST_REV_DAY:
        return (
            f"mean motion {elements.mean_motion_rev_day:g} rev/day is not that of an orbit about the Earth, which has "
            f"{SLOWEST_REV_DAY:g} to {FASTEST_REV_DAY:g}"
        )
    if not 0.0 <= elements.inclination_deg <= 180.0:
        return f"inclination {elements.inclination_deg:g} is not from 0 to 180 degrees"
    for what, angle in (
        ("right ascension", elements.raan_deg),
        ("argument of perigee", elements.argument_of_perigee_deg),
        ("mean anomaly", elements.mean_anomaly_deg),
    ):
        if not -360.0 <= angle <= 360.0:
            return f"{what} {angle:g} is not within 360 degrees"
    if elements.ephemeris_type == SGP4_XP:
        return "is for SGP4-XP (ephemeris type 4), another theory than SGP4"
    return None


def parse_epoch(text: str) -> tuple[datetime.datetime, float]:
    """Parse an epoch: a datetime truncated to microseconds, and the nanoseconds beyond them.

    Raises
    ------
    ValueError
        if the text is not a UTC instant from 1957 to 2200

    Examples
    --------
    >>> parse_epoch("2024-061T12:00:00.1234567")
    (datetime.datetime(2024, 3, 1, 12, 0, 0, 123456, tzinfo=datetime.timezone.utc), 700.0)
    """
    match = _EPOCH.fullmatch(text)
    if match is None:
        raise ValueError(f"EPOCH {quote_value(text)} is not a UTC instant such as 2024-09-17T12:00:00.123456")
    year, month, day, day_of_year, hour, minute, second, decimals, _ = match.groups()
    digits = (decimals or "").ljust(6, "0")
    try:
        if day_of_year:
            date = datetime.date(int(year), 1, 1) + datetime.timedelta(days=int(day_of_year) - 1)
            if date.year != int(year):
                raise ValueError("no such day")
            month, day = str(date.month), str(date.day)
        epoch = datetime.datetime(
            int(year), int(month), int(day), int(hour), int(minute), int(second), int(digits[:6]), tzinfo=datetime.UTC
        )
    except (ValueError, OverflowError):
        why = "is in a leap second or not a time of day" if int(second) >= 60 else "is not a calendar date"
        raise ValueError(f"EPOCH {quote_value(text)} {why}") from None
    if not 1957 <= epoch.year <= 2200:
        raise ValueError(f"EPOCH {quote_value(text)} is not between 1957 and 2200")
    return epoch, float(f"0.{digits[6:] or 0}") * 1e3


def _parse_number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return None
    if isinstance(value, str) and ("_" in value or not value.isascii()):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if math.isfinite(number) else None
