"""Instants and time scales: the only module with UTC, TAI, TT, GPS time and leap seconds.

Leap seconds and UT1 come from skyfield's built-in tables; nothing is ever downloaded. A run is counted in TAI seconds from
`start_utc`, so a leap second in the middle of it is an ordinary second. Julian dates are kept as a whole part and a
fraction: in one float64 a date is 40 us coarse, which is 0.3 m along a low orbit.

Epochs of a text are whole picoseconds of TAI since the start of 2000 (UTC), so that no date is rounded. In one float64 a
date of 2026 would be 0.1 us coarse, which is a millimetre along a low orbit.
"""

from __future__ import annotations

import datetime
import functools
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError

J2000_TT_JD = 2_451_545.0
CENTURY_DAYS = 36_525.0
TT_MINUS_TAI_S = 32.184

PS_PER_S = 10**12
TIME_SYSTEMS = ("UTC", "TAI", "TT", "GPS")
# The two date formats of CCSDS 301.0-B.
_LABELS = {"CALENDAR": r"(\d{4})-(\d{2})-(\d{2})", "DAY OF YEAR": r"(\d{4})-(\d{3})"}
_CLOCK = r"[T ](\d{2}):(\d{2}):(\d{2})(?:\.(\d*))?(Z?)"
_CALENDAR = re.compile(_LABELS["CALENDAR"] + _CLOCK, re.ASCII)
_DAY_OF_YEAR = re.compile(_LABELS["DAY OF YEAR"] + _CLOCK, re.ASCII)
_START = datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC)
_FIRST_YEAR, _LAST_YEAR = 1972, 2200  # before 1972 the second of UTC had another length
_TAI_MINUS_GPS_S = 19  # fixed when GPS time began on 1980-01-06 (IS-GPS-200, 3.3.4)
_MICROSECONDS = 1_000_000
_UTC_ORIGIN = datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.UTC)  # Julian day 2451545 of UTC


@functools.cache
def _timescale() -> Any:
    from skyfield.api import load

    return load.timescale(builtin=True)


@functools.cache
def _leap_table() -> tuple[np.ndarray, np.ndarray]:
    """Return when TAI - UTC changes [TAI s since JD 0], and the offsets before, between and after those instants [s]."""
    scale = _timescale()
    after = np.asarray(scale.leap_offsets, dtype=float)
    begins = np.asarray(scale.leap_dates, dtype=float) * units.DAY_S + after
    return begins, np.concatenate([after[:1] - 1.0, after])


def _leap_seconds(tai_s: np.ndarray | float) -> np.ndarray:
    """Return TAI - UTC [s] at whole TAI seconds since JD 0; a leap second belongs to the day that it ends."""
    begins, offsets = _leap_table()
    offset: np.ndarray = offsets[np.searchsorted(begins, tai_s, side="right")]
    return offset


@functools.lru_cache(maxsize=4096)
def _tai_us(instant: datetime.datetime) -> int:
    """Convert an aware datetime to TAI microseconds since JD 0, exactly."""
    since = instant - _UTC_ORIGIN
    utc_us = (since.days * 86_400 + since.seconds + 2_451_545 * 86_400) * _MICROSECONDS + since.microseconds
    # a datetime cannot name a leap second, so UTC alone decides which offset applies
    begins, offsets = _leap_table()
    offset = offsets[np.searchsorted(begins - offsets[1:], utc_us // _MICROSECONDS, side="right")]
    return utc_us + int(offset) * _MICROSECONDS


def check_instant(instant: Any, place: str) -> None:
    """Raise `ScenarioError` unless a value is a datetime with a UTC offset."""
    if not isinstance(instant, datetime.datetime):
        raise ScenarioError(
            f"{place}: needs a datetime with an offset, such as datetime(2024, 9, 17, 12, tzinfo=UTC), "
            f"not {instant!r:.60}; datetime.fromisoformat reads a text"
        )
    if instant.utcoffset() is None:
        raise ScenarioError(f"{place}: a time without an offset is ambiguous; end it with Z or +00:00")


@dataclass(frozen=True, eq=False)
class Epochs:
    """Instants of a run: seconds of TAI after a start.

    Parameters
    ----------
    start_utc : start of the run, an aware datetime
    time_s : (time,) seconds of TAI after the start [s]

    Raises
    ------
    ScenarioError
        if the start has no UTC offset, or the seconds are not one row of finite numbers

    Examples
    --------
    >>> start = datetime.datetime(2016, 12, 31, 23, 59, 55, tzinfo=datetime.UTC)
    >>> [format_utc(start, seconds) for seconds in (4, 5, 6)]
    ['2016-12-31T23:59:59.000Z', '2016-12-31T23:59:60.000Z', '2017-01-01T00:00:00.000Z']
    """

    start_utc: datetime.datetime
    time_s: np.ndarray

    def __post_init__(self) -> None:
        check_instant(self.start_utc, "start_utc")
        try:
            time_s = np.array(self.time_s, dtype=float, ndmin=1)
        except (TypeError, ValueError, OverflowError):
            raise ScenarioError(f"time_s: needs seconds after start_utc, not {self.time_s!r:.60}") from None
        if np.asarray(self.time_s).dtype.kind in "mM":
            raise ScenarioError("time_s: needs seconds after start_utc, not dates; subtract start_utc")
        if time_s.ndim != 1 or not np.all(np.isfinite(time_s)):
            raise ScenarioError("time_s: needs one row of finite seconds")
        time_s.flags.writeable = False
        object.__setattr__(self, "time_s", time_s)

    def __len__(self) -> int:
        return len(self.time_s)

    def at(self, which: int | slice | np.ndarray) -> Epochs:
        """Select some of the epochs.

        Parameters
        ----------
        which : an index (the result still is a row, of length 1), a slice, an array of indices, or a mask

        Returns
        -------
        Epochs
            the selected epochs after the same start
        """
        return Epochs(self.start_utc, self.time_s[which])

    def shift(self, seconds: float | np.ndarray) -> Epochs:
        """Shift all epochs.

        Parameters
        ----------
        seconds : shift, a number or (time,) [s]; positive is later

        Returns
        -------
        shifted epochs with the same `start_utc`
        """
        return Epochs(self.start_utc, self.time_s + seconds)

    def since(self, instant: datetime.datetime) -> np.ndarray:
        """Return the TAI seconds (time,) from an instant to each epoch. A leap second counts as a second.

        Parameters
        ----------
        instant : aware datetime

        Raises
        ------
        ScenarioError
            if it is not a datetime with a UTC offset
        """
        check_instant(instant, "since")
        offset: np.ndarray = self.time_s + (_tai_us(self.start_utc) - _tai_us(instant)) / _MICROSECONDS
        return offset

    def utc_julian(self, leap_seconds_at: datetime.datetime | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return UTC Julian dates as whole part and fraction (time,) [day], split as skyfield hands them to sgp4.

        Parameters
        ----------
        leap_seconds_at : instant whose leap seconds are used throughout. SGP4 subtracts dates, so an element set from
            before a leap second would otherwise be propagated one second too far, some 7 km
        """
        seconds, fraction_s = self._tai()
        whole, in_day = np.divmod(seconds, units.DAY_S)
        leap: np.ndarray | float
        if leap_seconds_at is None:
            leap = _leap_seconds(seconds)
        else:
            leap = float(_leap_seconds(_tai_us(leap_seconds_at) // _MICROSECONDS))
        return whole, (in_day + fraction_s) / units.DAY_S - leap / units.DAY_S

    def tt_julian(self) -> tuple[np.ndarray, np.ndarray]:
        """Return TT Julian dates as whole part and fraction (time,) [day]."""
        seconds, fraction_s = self._tai()
        whole, in_day = np.divmod(seconds, units.DAY_S)
        return whole, (in_day + fraction_s) / units.DAY_S + TT_MINUS_TAI_S / units.DAY_S

    def tt_centuries(self) -> np.ndarray:
        """Return Julian centuries (time,) of TT since J2000.0."""
        whole, fraction = self.tt_julian()
        centuries: np.ndarray = ((whole - J2000_TT_JD) + fraction) / CENTURY_DAYS
        return centuries

    def tai_seconds(self) -> np.ndarray:
        """Return TAI seconds (time,) since JD 0, to 30 us: for tables that change slowly."""
        whole, fraction = self._tai()
        seconds: np.ndarray = whole + fraction
        return seconds

    def skyfield_time(self) -> Any:
        """Return the epochs as a skyfield Time (time,) in its full split precision."""
        seconds, fraction_s = self._tai()
        whole, in_day = np.divmod(seconds, units.DAY_S)
        return _timescale().tai_jd(whole, (in_day + fraction_s) / units.DAY_S)

    def _tai(self) -> tuple[np.ndarray, np.ndarray]:
        """Return whole TAI seconds since JD 0, and the fraction of a second in [0, 1) (time,)."""
        start_s, start_us = divmod(_tai_us(self.start_utc), _MICROSECONDS)
        whole = np.floor(self.time_s)
        carry, fraction = np.divmod((self.time_s - whole) + start_us / _MICROSECONDS, 1.0)
        return start_s + whole + carry, fraction


def tai_from_utc_days(mjd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return TAI seconds since JD 0, and TAI - UTC [s], at modified Julian dates (row,) of UTC."""
    begins, offsets = _leap_table()
    utc_s = (mjd + 2_400_000.5) * units.DAY_S
    leap_s = offsets[np.searchsorted(begins - offsets[1:], utc_s, side="right")]
    return utc_s + leap_s, leap_s


def skyfield_tt(whole: np.ndarray | float, fraction: np.ndarray) -> Any:
    """Return a skyfield Time of TT Julian dates split into whole part and fraction [day]."""
    return _timescale().tt_jd(whole, fraction)


def format_utc(start_utc: datetime.datetime, time_s: float) -> str:
    """Format an instant as ISO 8601 text in UTC, to the millisecond.

    Parameters
    ----------
    start_utc : start of the run, an aware datetime
    time_s : seconds of TAI after the start [s]

    Returns
    -------
    str
        such as 2024-09-17T12:01:30.250Z; a leap second reads 23:59:60

    Examples
    --------
    >>> format_utc(datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), 90.25)
    '2024-09-17T12:01:30.250Z'
    """
    text: str = Epochs(start_utc, np.array([time_s])).skyfield_time().utc_iso(places=3)[0]
    return text


def parse_epoch_ps(text: str, system: str, where: str) -> int:
    """Parse an epoch of a CCSDS message: calendar date or day of year, in UTC, TAI, TT or GPS time.

    Parameters
    ----------
    system : one of `TIME_SYSTEMS`

    Returns
    -------
    int
        picoseconds of TAI since the start of 2000 (UTC)

    Raises
    ------
    ScenarioError
        if the text is not an epoch, or names a day or time of day that does not exist

    Examples
    --------
    >>> parse_epoch_ps("2017-01-01T00:00:00", "UTC", "-") - parse_epoch_ps("2016-12-31T23:59:60", "UTC", "-")
    1000000000000
    """
    match = _CALENDAR.fullmatch(text) or _DAY_OF_YEAR.fullmatch(text)
    if match is None:
        raise ScenarioError(f"{where}: epoch '{text:.40}'; write 2024-09-17T12:00:00.000 or 2024-261T12:00:00.000")
    *date, hour, minute, second, fraction, _zulu = match.groups()
    year = int(date[0])
    if not _FIRST_YEAR <= year <= _LAST_YEAR:
        raise ScenarioError(f"{where}: epoch '{text}' is not between {_FIRST_YEAR} and {_LAST_YEAR}; correct the year")
    try:
        if len(date) == 3:
            day = datetime.date(year, int(date[1]), int(date[2]))
        else:
            day = datetime.date(year, 1, 1) + datetime.timedelta(days=int(date[1]) - 1)
            if day.year != year:
                raise ValueError
    except ValueError:
        raise ScenarioError(f"{where}: epoch '{text}': this day does not exist; correct the date") from None
    in_day = int(hour) * 3600 + int(minute) * 60 + int(second)
    leap = int(second) == 60 and system == "UTC" and in_day == 86_400 and _day_length_s(day) == 86_401
    if int(hour) > 23 or int(minute) > 59 or (int(second) > 59 and not leap):
        raise ScenarioError(f"{where}: epoch '{text}': this time of day does not exist; correct it")
    ps = int(f"{fraction or '':0<12.12}")
    if system == "UTC":
        return (_midnight_s(day) + in_day) * PS_PER_S + ps
    return ((day - _START.date()).days * 86_400 + in_day) * PS_PER_S + ps - _lead_ps(system)


@functools.lru_cache(maxsize=4096)
def _midnight_s(day: datetime.date) -> int:
    """Return the TAI seconds from the start of 2000 (UTC) to the start of a UTC day."""
    midnight = datetime.datetime(day.year, day.month, day.day, tzinfo=datetime.UTC)
    return round(float(Epochs(midnight, np.zeros(1)).since(_START)[0]))


def _day_length_s(day: datetime.date) -> int:
    return _midnight_s(day + datetime.timedelta(days=1)) - _midnight_s(day)


@functools.cache
def _lead_ps(system: str) -> int:
    """Return by how much a clock of TAI, TT or GPS is ahead of UTC at the start of 2000 [ps]."""
    whole, fraction = Epochs(_START, np.zeros(1)).tt_julian()
    tt_ps = round(((float(whole[0]) - 2_451_544.0) + (float(fraction[0]) - 0.5)) * 86_400_000) * 10**9
    tai_lead_ps = tt_ps - round(TT_MINUS_TAI_S * 1000) * 10**9
    return {"TT": tt_ps, "TAI": tai_lead_ps, "GPS": tai_lead_ps - _TAI_MINUS_GPS_S * PS_PER_S}[system]


def floor_to_utc_second(ps: int) -> tuple[datetime.datetime, int]:
    """Return the last whole second of UTC at or before an instant, as a datetime and in picoseconds.

    A datetime cannot name a leap second, so within one the second before it is returned.
    """
    day = _START.date() + datetime.timedelta(days=ps // (86_400 * PS_PER_S))
    while _midnight_s(day) * PS_PER_S > ps:
        day -= datetime.timedelta(days=1)
    in_day = min(ps // PS_PER_S - _midnight_s(day), 86_399)
    start = datetime.datetime(day.year, day.month, day.day, tzinfo=datetime.UTC) + datetime.timedelta(seconds=in_day)
    return start, (_midnight_s(day) + in_day) * PS_PER_S


def tai_ps_from_utc(instant: datetime.datetime) -> int:
    """Convert an aware datetime to picoseconds of TAI since the start of 2000 (UTC)."""
    utc = instant.astimezone(datetime.UTC)
    in_day = utc.hour * 3600 + utc.minute * 60 + utc.second
    return (_midnight_s(utc.date()) + in_day) * PS_PER_S + utc.microsecond * 1_000_000


def format_epochs(epochs: Epochs) -> list[str]:
    """Format instants as ISO calendar text in UTC, to the picosecond where needed and to the millisecond at least."""
    start_ps = tai_ps_from_utc(epochs.start_utc)
    texts = []
    for time_s in epochs.time_s.tolist():
        whole = int(time_s // 1.0)
        texts.append(format_epoch_ps(start_ps + whole * PS_PER_S + round((time_s - whole) * PS_PER_S)))
    return texts


def format_epoch_ps(ps: int) -> str:
    """Format an instant [ps of TAI since the start of 2000 UTC] as ISO calendar text in UTC, without a Z."""
    start, start_ps = floor_to_utc_second(ps)
    seconds, rest = divmod(ps - start_ps, PS_PER_S)
    digits = f"{rest:012d}".rstrip("0")
    return f"{start:%Y-%m-%dT%H:%M}:{start.second + seconds:02d}.{digits:0<3}"
