"""Tracking data messages (CCSDS 503.0-B, TDM): ranges and angles, read from keyword = value text or XML, and written."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.errors import RecordingError, ScenarioError, did_you_mean, warn_of_input
from rso_lidar.files import write_text
from rso_lidar.orbit.ccsds.kvn import format_kvn, make_header
from rso_lidar.orbit.ccsds.message import CcsdsMessage, CcsdsSegment, Entry, check_increasing, parse_number
from rso_lidar.orbit.ccsds.reader import find_table, read_message, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import parse_frame
from rso_lidar.orbit.earth.axes import EarthAxes, gcrs_from_axes
from rso_lidar.orbit.epochs import PS_PER_S, Epochs, floor_to_utc_second, format_epochs, parse_epoch_ps

_RANGE_UNITS = {"km": units.KM, "s": units.SPEED_OF_LIGHT_M_S}
_POSITION_KEYS = ("RANGE", "ANGLE_1", "ANGLE_2")
_MOST_ANGLE_DEG = 360.0  # CCSDS 503.0-B-2 has -180 to 360; others write -275 for 85
_SPAN_EDGE_PS = PS_PER_S  # one second: the span may be stated with fewer digits than the rows
_CORRECTED = tuple(f"CORRECTION_{key}" for key in _POSITION_KEYS)


@dataclass(frozen=True, eq=False)
class TrackingSegment:
    """Measurements of one segment of a tracking data message.

    Parameters
    ----------
    where : file and line of the segment
    observer, target : participants that measure and that are measured: first and second of the path of a signal that comes
        back, last and first of one that does not
    is_two_way : whether the signal comes back to the observer
    records : by keyword, such as "RANGE" and "RCS": instants since the message's `start_utc` [s] and values (measurement),
        in the units of the standard, without corrections
    range_unit_m : unit of ranges [m]; 299,792,458 where they are in seconds
    angle_type : ANGLE_TYPE of the message; empty without one
    frame : axes of right ascension and declination; None where the message states none
    correction_range_m, correction_rad : what is to be added to ranges [m], and to the two angles [rad]: 0 where the message
        states no correction, or one that it has applied
    sigma_range_m, sigma_angle_rad : standard deviations of a measurement, by comments of this package; None without them
    sigma_offset_m : standard deviations of a constant offset of what is measured from the target's origin, along the line of
        sight and across it, by comments of this package; 0 without them
    """

    where: str
    observer: str
    target: str
    is_two_way: bool
    records: Mapping[str, tuple[np.ndarray, np.ndarray]]
    range_unit_m: float
    angle_type: str
    frame: EarthAxes | None
    correction_range_m: float
    correction_rad: tuple[float, float]
    sigma_range_m: float | None
    sigma_angle_rad: float | None
    sigma_offset_m: tuple[float, float]


@dataclass(frozen=True, eq=False)
class TrackingDataMessage:
    """A tracking data message (TDM): segments of measurements.

    Parameters
    ----------
    where : name of the source
    originator : as the message gives it; empty where it does not
    start_utc : whole second of UTC at or before the first measurement, from which times count
    segments : those with ranges or angles, in the order of the message
    """

    where: str
    originator: str
    start_utc: datetime.datetime
    segments: tuple[TrackingSegment, ...]

    @classmethod
    def from_file(cls, path: str | Path) -> TrackingDataMessage:
        """Read a message in keyword = value notation or XML.

        Parameters
        ----------
        path : path of the file; a relative one is looked up in the working folder, then among the shipped data

        Returns
        -------
        TrackingDataMessage

        Raises
        ------
        ScenarioError
            if the file cannot be read, or does not follow the format; the message names the line
        """
        return cls.from_text(read_table_text(find_table(str(path))[0]), str(path))

    @classmethod
    def from_text(cls, text: str, where: str = "TDM") -> TrackingDataMessage:
        """Read a message from a text.

        Parameters
        ----------
        text : the message in keyword = value notation or XML
        where : name of the text, for messages

        Returns
        -------
        TrackingDataMessage

        Raises
        ------
        ScenarioError
            if the text does not follow the format; the message names the line
        """
        message = read_message(text, "TDM", where)
        used = [
            (segment, _read_stamps(message, segment))
            for segment in message.segments
            if any(cells and cells[0] in _POSITION_KEYS for _, cells in segment.rows)
        ]
        if not used:
            raise ScenarioError(
                f"{where}: has no range and no angle; give lines such as RANGE = epoch value after DATA_START"
            )
        start_utc, start_ps = floor_to_utc_second(
            min(ps for _, rows in used for series in rows.values() for ps, _ in series)
        )
        segments = tuple(_read_segment(message, segment, series, start_ps) for segment, series in used)
        originator = message.header.get("ORIGINATOR")
        return cls(where, originator.value if originator else "", start_utc, segments)

    @property
    def targets(self) -> list[str]:
        """Names of the targets, in the order of the message."""
        return list(dict.fromkeys(segment.target for segment in self.segments))

    def select_target(self, target: str | None = None) -> list[TrackingSegment]:
        """Return the segments of a target.

        Parameters
        ----------
        target : its name in any case; None for the only one

        Returns
        -------
        list of TrackingSegment

        Raises
        ------
        ScenarioError
            for another name, for several targets without a name, and for measurements by several observers
        """
        names = self.targets
        if target is None and len(names) > 1:
            raise ScenarioError(f"{self.where}: has several targets ({', '.join(names)}); choose one of them")
        chosen = [each for each in self.segments if target is None or each.target.upper() == target.upper()]
        if not chosen:
            guess = did_you_mean(str(target), names)
            raise ScenarioError(f"{self.where}: no target '{target}'{guess} (targets: {', '.join(names)})")
        observers = list(dict.fromkeys(each.observer for each in chosen))
        if len(observers) > 1:
            raise ScenarioError(f"{self.where}: {', '.join(observers)} measure the target; give the segments of one")
        return chosen

    def find_positions(self, target: str | None = None, *, round_trip: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return the positions of a target from its observer at the instants that have range and both angles.

        Corrections that the message states and has not applied are added. Light time is left out: poses are simultaneous.

        Parameters
        ----------
        target : its name; None for the only one
        round_trip : whether a range of a signal that comes back is the length of both ways; otherwise it is half of that.
            The standard leaves this to the partners (503.0-B-2, 3.5.2.7)

        Returns
        -------
        time_s : (measurement,) instants since `start_utc`, ascending [s]
        position_m : (measurement, 3) of the target minus the observer in GCRS axes [m]

        Raises
        ------
        ScenarioError
            if no instant has all three, or the angles are not right ascension and declination in an inertial frame
        """
        ranges: dict[float, float] = {}
        lines: dict[float, np.ndarray] = {}
        for segment in self.select_target(target):
            if "RANGE" in segment.records:
                time_s, values = segment.records["RANGE"]
                share = 0.5 if round_trip and segment.is_two_way else 1.0
                range_m = share * (values * segment.range_unit_m + segment.correction_range_m)
                ranges |= zip(time_s.tolist(), range_m.tolist(), strict=True)
            if "ANGLE_1" in segment.records or "ANGLE_2" in segment.records:
                lines |= _find_lines(segment, self.start_utc)
        common = sorted(ranges.keys() & lines.keys())
        if not common:
            raise ScenarioError(
                f"{self.where}: no instant has RANGE, ANGLE_1 and ANGLE_2 ({len(ranges)} ranges, {len(lines)} directions); "
                "give all three at the same instants"
            )
        range_m = np.array([ranges[at_s] for at_s in common])
        if not (range_m > 0.0).all():
            raise ScenarioError(f"{self.where}: a range is not above 0; correct it")
        return np.array(common), range_m[:, None] * np.array([lines[at_s] for at_s in common])


def _find_lines(segment: TrackingSegment, start_utc: datetime.datetime) -> dict[float, np.ndarray]:
    """Return unit vectors (3,) in GCRS axes by the instants that have both angles."""
    if segment.angle_type != "RADEC":
        raise ScenarioError(
            f"{segment.where}: ANGLE_TYPE {segment.angle_type or 'is missing'}; only RADEC, in an inertial frame, gives a "
            "direction without a station"
        )
    if segment.frame is None or segment.frame == "itrs":
        raise ScenarioError(
            f"{segment.where}: RADEC needs an inertial REFERENCE_FRAME, such as EME2000 or ICRF; add it"
        )
    (first_s, first), (second_s, second) = (
        segment.records.get(key, (np.zeros(0), np.zeros(0))) for key in _POSITION_KEYS[1:]
    )
    time_s, left, right = np.intersect1d(first_s, second_s, return_indices=True)
    ascension, declination = (
        values * units.DEG + correction
        for values, correction in zip((first[left], second[right]), segment.correction_rad, strict=True)
    )
    flat = np.cos(declination)
    there = np.stack([flat * np.cos(ascension), flat * np.sin(ascension), np.sin(declination)], axis=-1)
    matrix = gcrs_from_axes(segment.frame, Epochs(start_utc, time_s))
    return dict(zip(time_s.tolist(), np.einsum("nij,nj->ni", matrix, there), strict=True))


def _read_stamps(message: CcsdsMessage, segment: CcsdsSegment) -> dict[str, list[tuple[int, float]]]:
    """Read the rows of a segment: by keyword, instants [ps of TAI since the start of 2000] and values."""
    system = message.time_system(segment)
    series: dict[str, list[tuple[int, float]]] = {}
    lines: dict[str, list[int]] = {}
    for line, cells in segment.rows:
        here = f"{message.where}: line {line}"
        if len(cells) != 3:
            raise ScenarioError(f"{here}: a measurement is KEYWORD = epoch value; correct the line")
        key, epoch, text = cells
        value = parse_number(here, key, text)
        if key in _POSITION_KEYS[1:] and abs(value) > _MOST_ANGLE_DEG:
            raise ScenarioError(
                f"{here}: {key} is {value:g} deg, more than a turn; correct it, or leave the row out where nothing was "
                "measured"
            )
        series.setdefault(key, []).append((parse_epoch_ps(epoch, system, here), value))
        lines.setdefault(key, []).append(line)
    _check_span(message, segment, system, [ps for rows in series.values() for ps, _ in rows])
    for key in _POSITION_KEYS:
        if key in series:
            check_increasing(message.where, [ps for ps, _ in series[key]], lines[key])
    return series


def _check_span(message: CcsdsMessage, segment: CcsdsSegment, system: str, stamps: list[int]) -> None:
    """Warn where rows lie outside the span that START_TIME and STOP_TIME state."""
    for key, sign in (("START_TIME", 1), ("STOP_TIME", -1)):
        stated = segment.meta.get(key)
        if stated is None or not stamps:
            continue
        edge_ps = message.stamp(stated, system)
        outside = sum(sign * (edge_ps - ps) > _SPAN_EDGE_PS for ps in stamps)
        if outside:
            side = "before" if sign > 0 else "after"
            warn_of_input(
                f"{message.where}: line {stated.line}: {outside:,} of {len(stamps):,} rows are {side} {key} {stated.value}, "
                "and are used all the same; correct one of them"
            )


def _read_segment(
    message: CcsdsMessage, segment: CcsdsSegment, series: dict[str, list[tuple[int, float]]], start_ps: int
) -> TrackingSegment:
    """Read the metadata of a segment beside its rows."""
    at = f"{message.where}: line {segment.line}"
    mode = segment.meta.get("MODE")
    if mode is not None and mode.value.upper() != "SEQUENTIAL":
        raise ScenarioError(
            f"{message.where}: line {mode.line}: MODE {mode.value}; only SEQUENTIAL is supported: leave differenced data out"
        )
    path = message.require(segment, "PATH")
    stops = path.value.replace(" ", "").split(",")
    if len(stops) not in (2, 3) or (len(stops) == 3 and stops[0] != stops[2]) or stops[0] == stops[1]:
        raise ScenarioError(f"{message.where}: line {path.line}: PATH {path.value}; only a,b and a,b,a are supported")
    names = [message.require(segment, f"PARTICIPANT_{stop}").value for stop in stops]
    unit = segment.meta.get("RANGE_UNITS", Entry("km", segment.line))
    if unit.value.lower() not in _RANGE_UNITS:
        raise ScenarioError(f"{message.where}: line {unit.line}: RANGE_UNITS {unit.value}; write ranges in km or s")
    modulus = segment.meta.get("RANGE_MODULUS")
    if modulus is not None and parse_number(f"{message.where}: line {modulus.line}", "RANGE_MODULUS", modulus.value):
        raise ScenarioError(f"{message.where}: line {modulus.line}: ambiguous ranges are not supported; resolve them")
    range_unit_m = _RANGE_UNITS[unit.value.lower()]
    corrections = _read_corrections(message, segment)
    angle_type, frame = segment.meta.get("ANGLE_TYPE"), segment.meta.get("REFERENCE_FRAME")
    records = {
        key: (np.array([(ps - start_ps) / PS_PER_S for ps, _ in rows]), np.array([value for _, value in rows]))
        for key, rows in series.items()
    }
    is_two_way = len(stops) == 3
    return TrackingSegment(
        where=at,
        observer=names[0] if is_two_way else names[1],
        target=names[1] if is_two_way else names[0],
        is_two_way=is_two_way,
        records=records,
        range_unit_m=range_unit_m,
        angle_type=angle_type.value.upper() if angle_type else "",
        frame=parse_frame(frame.value, f"{message.where}: line {frame.line}") if frame else None,
        correction_range_m=corrections[0] * range_unit_m,
        correction_rad=(corrections[1] * units.DEG, corrections[2] * units.DEG),
        sigma_range_m=_read_sigma(message, segment, "SIGMA_RANGE", 1.0),
        sigma_angle_rad=_read_sigma(message, segment, "SIGMA_ANGLE", units.DEG),
        sigma_offset_m=(
            _read_sigma(message, segment, "SIGMA_OFFSET_ALONG", 1.0) or 0.0,
            _read_sigma(message, segment, "SIGMA_OFFSET_ACROSS", 1.0) or 0.0,
        ),
    )


def _read_corrections(message: CcsdsMessage, segment: CcsdsSegment) -> list[float]:
    """Read what is to be added to range and angles, in the units of the message: 0 where it is applied already."""
    given = [entry for key, entry in segment.meta.items() if key.startswith("CORRECTION_")]
    if not given:
        return [0.0, 0.0, 0.0]
    applied = segment.meta.get("CORRECTIONS_APPLIED")
    if applied is None or applied.value.upper() not in ("YES", "NO"):
        line = given[0].line if applied is None else applied.line
        raise ScenarioError(
            f"{message.where}: line {line}: a segment with corrections states CORRECTIONS_APPLIED = YES or NO; add it"
        )
    if applied.value.upper() == "YES":
        return [0.0, 0.0, 0.0]
    values = []
    for key in _CORRECTED:
        entry = segment.meta.get(key)
        values.append(parse_number(f"{message.where}: line {entry.line}", key, entry.value) if entry else 0.0)
    return values


def _read_sigma(message: CcsdsMessage, segment: CcsdsSegment, key: str, scale: float) -> float | None:
    """Read a standard deviation from a comment of this package; None without it."""
    entry = segment.meta.get(f"COMMENT {key}")
    if entry is None:
        return None
    value = parse_number(f"{message.where}: line {entry.line}", key, entry.value)
    if not value > 0.0:
        raise ScenarioError(f"{message.where}: line {entry.line}: {key} is {value:g}; give a number above 0")
    return value * scale


def write_tdm(
    path: str | Path,
    observer: str,
    target: str,
    epochs: Epochs,
    position_m: np.ndarray,
    *,
    sigma_range_m: float | None = None,
    sigma_angle_rad: float | None = None,
    sigma_offset_m: tuple[float, float] | None = None,
    correction_range_m: float | None = None,
    corrections_applied: bool = False,
    comments: Sequence[str] = (),
    originator: str = "RSO_LIDAR",
    created_utc: datetime.datetime | None = None,
    overwrite: bool = False,
) -> Path:
    """Write measured positions of a target as a TDM (keyword = value; UTC): range, right ascension and declination.

    Ranges are half of the two ways of light, to 1e-6 m; angles are in ICRF axes, to 1e-12 deg. The standard has no keyword
    for the noise of a measurement and for the counts of a lidar, so both are comments.

    Parameters
    ----------
    path : path of the file
    observer, target : names of the two participants
    epochs : instants at which the light was sent, ascending
    position_m : (measurement, 3) of the target minus the observer in GCRS axes [m], as measured

    Other Parameters
    ----------------
    sigma_range_m, sigma_angle_rad : standard deviations of a measurement [m], [rad]; in comments SIGMA_RANGE and SIGMA_ANGLE
    sigma_offset_m : standard deviations of a constant offset of what is measured from the target's origin, along the line of
        sight and across it [m]; in comments SIGMA_OFFSET_ALONG and SIGMA_OFFSET_ACROSS
    correction_range_m : what is to be added to the ranges, or has been [m]
    corrections_applied : whether the correction is in the ranges
    comments : lines of text before the measurements
    originator : ORIGINATOR of the message
    created_utc : CREATION_DATE, now if left out
    overwrite : whether an existing file is replaced

    Returns
    -------
    Path
        the path

    Raises
    ------
    RecordingError
        if the measurements make no message, or the file cannot be written
    """
    line_m = np.atleast_2d(np.asarray(position_m, dtype=float))
    range_m = np.sqrt((line_m**2).sum(axis=-1))
    if not len(epochs) or line_m.shape != (len(epochs), 3) or not (np.isfinite(range_m) & (range_m > 0.0)).all():
        raise RecordingError("tdm: needs finite positions (measurement, 3) at one or more epochs; leave out the others")
    if not (np.diff(epochs.time_s) >= 1e-9).all():
        raise RecordingError("tdm: epochs grow by 1 ns or more; sort them")
    texts = format_epochs(epochs)
    meta = {
        "TIME_SYSTEM": "UTC",
        "START_TIME": texts[0],
        "STOP_TIME": texts[-1],
        "PARTICIPANT_1": observer,
        "PARTICIPANT_2": target,
        "MODE": "SEQUENTIAL",
        "PATH": "1,2,1",
        "TIMETAG_REF": "TRANSMIT",
        "RANGE_UNITS": "km",
        "ANGLE_TYPE": "RADEC",
        "REFERENCE_FRAME": "ICRF",
        "DATA_QUALITY": "RAW",
    }
    if correction_range_m is not None:
        meta["CORRECTION_RANGE"] = f"{correction_range_m / units.KM:.9f}"
        meta["CORRECTIONS_APPLIED"] = "YES" if corrections_applied else "NO"
    notes = ["RANGE is half of the length of both ways of the light; angles are those of the line of sight at emission"]
    if sigma_range_m is not None:
        notes.append(f"SIGMA_RANGE = {sigma_range_m:.6g} [m]")
    if sigma_angle_rad is not None:
        notes.append(f"SIGMA_ANGLE = {sigma_angle_rad / units.DEG:.6g} [deg]")
    for name, sigma_m in zip(("ALONG", "ACROSS"), sigma_offset_m or (), strict=False):
        if sigma_m > 0.0:
            notes.append(f"SIGMA_OFFSET_{name} = {sigma_m:.6g} [m]")
    notes += comments
    if bad := [note for note in notes if not note.isascii() or not note.isprintable() or len(note) > 200]:
        raise RecordingError(f"tdm: comment {bad[0]!r:.60}: the format allows up to 200 printable ASCII characters")
    rows = [f"COMMENT {note}" for note in notes]
    ascension_deg = np.mod(np.arctan2(line_m[:, 1], line_m[:, 0]) / units.DEG, 360.0)
    declination_deg = np.arctan2(line_m[:, 2], np.hypot(line_m[:, 0], line_m[:, 1])) / units.DEG
    for text, *values in zip(texts, range_m / units.KM, ascension_deg, declination_deg, strict=True):
        digits = (9, 12, 12)
        rows += [
            f"{key} = {text} {value:.{places}f}"
            for key, value, places in zip(_POSITION_KEYS, values, digits, strict=True)
        ]
    content = format_kvn("TDM", "2.0", make_header(originator, created_utc), [(meta, rows)])
    return write_text(path, content, overwrite=overwrite)
