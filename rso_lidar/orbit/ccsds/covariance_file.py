"""Covariances read from CCSDS messages: OEM and OPM (502.0-B), and CDM (508.0-B), in keyword = value text or XML."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rso_lidar.errors import PropagationError, ScenarioError, did_you_mean, warn_of_input
from rso_lidar.orbit.ccsds.conjunction_message import ConjunctionMessage
from rso_lidar.orbit.ccsds.csv_table import elapsed_from_ps
from rso_lidar.orbit.ccsds.ephemeris import Ephemeris
from rso_lidar.orbit.ccsds.keywords import GREATEST_TERM, KEYWORD, KeywordBlock, StatedValue
from rso_lidar.orbit.ccsds.message import CcsdsMessage, CcsdsSegment, parse_number, select_segments
from rso_lidar.orbit.ccsds.reader import find_table, is_message_of, read_message, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import StateFrame, parse_orbit_frame, warn_without_orientation
from rso_lidar.orbit.ccsds.state_message import STATE_KEYS, OrbitParameterMessage, read_triangle
from rso_lidar.orbit.earth.axes import EARTH_AXES
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.two_body.covariance_history import CovarianceHistory, describe_unlikely_units
from rso_lidar.orbit.two_body.kepler import State

_TERMS = tuple(f"C{row}_{column}" for k, row in enumerate(STATE_KEYS) for column in STATE_KEYS[: k + 1])


def read_covariances(
    path: str | Path, name: str | None = None, *, earth_orientation_file: str | None = None
) -> CovarianceHistory:
    """Read the covariances of one object from a CCSDS message, with the orbit about which they are.

    An OEM has covariances at epochs of their own, each in its own frame (COV_REF_FRAME, else that of the segment), an OPM
    one, and a CDM one for each of its objects, in its RTN axes. Frames are GCRF, ICRF, EME2000, MOD, TOD, TEME and ITRF, and
    of the orbit RTN (RSW), TNW, NTW, VNC and LVLH. Velocities along axes of the orbit are relative to inertial axes, unless
    the name ends in _ROTATING. Terms of an OEM and an OPM are in km2, those of a CDM in m2; a warning names sigmas that
    look like another unit.

    Parameters
    ----------
    path : path of the file; a relative one is looked up in the working folder, then among the shipped data
    name : name or identifier of the object, of a CDM also OBJECT1 or OBJECT2; None for the only one

    Other Parameters
    ----------------
    earth_orientation_file : path of the IERS file finals2000A.all, with polar motion and UT1, for states in ITRF

    Returns
    -------
    CovarianceHistory

    Raises
    ------
    ScenarioError
        if the file cannot be read, does not follow its format, or has no such object or no covariance; the message names
        the line
    """
    where = str(path)
    text = read_table_text(find_table(where)[0])
    orientation = None if earth_orientation_file is None else EarthOrientation.from_file(earth_orientation_file)
    if is_message_of("OEM", text):
        history = _read_ephemeris(text, where, name, earth_orientation_file, orientation)
    elif is_message_of("OPM", text):
        history = _read_state(OrbitParameterMessage.from_text(text, where, orientation), name)
    elif is_message_of("CDM", text):
        history = _read_conjunction(ConjunctionMessage.from_text(text, where), name)
    else:
        raise ScenarioError(f"{where}: is no OEM, OPM or CDM, which hold covariances; give one of them")
    if is_message_of("CDM", text):  # its unknown components are large on purpose
        slip = describe_unlikely_units(history.matrices, "m", "larger")
    else:
        slip = describe_unlikely_units(history.matrices, "km", "smaller")
    if slip:
        warn_of_input(f"{where}: {history.label}: {slip}")
    return history


def _read_state(message: OrbitParameterMessage, name: str | None) -> CovarianceHistory:
    """Return the covariance of an OPM."""
    known = [word for word in (message.object_name, message.object_id) if word]
    if name is not None and name.upper() not in (word.upper() for word in known):
        raise ScenarioError(
            f"{message.where}: unknown object '{name}'{did_you_mean(name, known)} (object: {', '.join(known)})"
        )
    if message.covariance is None:
        raise ScenarioError(f"{message.where}: has no covariance; add CX_X to CZ_DOT_Z_DOT")
    epochs = Epochs(message.state.epoch_utc, np.zeros(1))
    return CovarianceHistory(
        message.object_name or message.object_id, message.where, message.state, epochs, message.covariance[None]
    )


def _read_conjunction(message: ConjunctionMessage, name: str | None) -> CovarianceHistory:
    """Return the covariance of one object of a CDM at the closest approach."""
    objects = {"OBJECT1": message.first, "OBJECT2": message.second}
    chosen = [
        body
        for key, body in objects.items()
        if name is not None
        and name.upper() in (key, body.name.upper(), body.designator.upper(), body.international_designator.upper())
    ]
    if len(chosen) != 1:
        known = ", ".join(f"{key} {body.label}" for key, body in objects.items())
        if name is None or chosen:
            raise ScenarioError(
                f"{message.where}: has two objects ({known}); give the name of one, or OBJECT1 or OBJECT2"
            )
        words = [word for body in objects.values() for word in (body.name, body.designator)]
        raise ScenarioError(f"{message.where}: unknown object '{name}'{did_you_mean(name, words)} (objects: {known})")
    body = chosen[0]
    epochs = Epochs(message.tca_utc, np.zeros(1))
    reference = State(
        epoch_utc=message.tca_utc,
        position_m=tuple(body.position_m.tolist()),
        velocity_m_s=tuple(body.velocity_m_s.tolist()),
    )
    return CovarianceHistory(
        body.label, message.where, reference, epochs, body.covariance[None], has_velocity=body.has_velocity_covariance
    )


def _read_ephemeris(
    text: str, where: str, name: str | None, orientation_file: str | None, orientation: EarthOrientation | None
) -> CovarianceHistory:
    """Return the covariances of one object of an OEM."""
    message = read_message(text, "OEM", where)
    stamps, frames, lines, terms = list[int](), list[StateFrame](), list[int](), list[np.ndarray]()
    segments = select_segments(message, name)
    for segment in segments:
        for block, cells in _split_blocks(message, segment):
            epoch = block.find("EPOCH")
            assert epoch is not None
            named = block.find("COV_REF_FRAME") or message.require(segment, "REF_FRAME")
            frame = parse_orbit_frame(named.value, f"{where}: line {named.line}")
            system, fixed = message.time_system(segment), segment.meta.get("REF_FRAME_EPOCH")
            if fixed is not None and frame.axes in EARTH_AXES:
                frame = replace(frame, frozen_ps=message.stamp(fixed, system))
            stamp = message.stamp(epoch, system)
            if stamps and stamp == stamps[-1]:  # where two segments meet the later one applies
                for kept in (stamps, frames, lines, terms):
                    kept.pop()
            stamps.append(stamp)
            frames.append(frame)
            lines.append(epoch.line)
            terms.append(_read_terms(block, cells))
    label = message.require(segments[0], "OBJECT_NAME").value
    if not stamps:
        raise ScenarioError(f"{where}: has no covariance of {label}; add COVARIANCE_START ... COVARIANCE_STOP")
    start_utc, time_s = elapsed_from_ps(stamps)
    epochs = Epochs(start_utc, time_s)
    reference = Ephemeris(file=where, object=name, earth_orientation_file=orientation_file)
    try:
        states = reference.states(epochs)
    except PropagationError as error:
        first, last = reference.span_utc(start_utc)
        raise ScenarioError(
            f"{where}: line {lines[int(np.argmax(error.bad))]}: a covariance outside the states of {label}, which span "
            f"{first} to {last}; correct its EPOCH, add states about it, or remove it"
        ) from None
    if any(frame.axes == "itrs" for frame in frames) and orientation is None:
        cure = "name finals2000A.all of the IERS as earth_orientation_file"
        warn_without_orientation(f"{where}: a covariance", states.position_m, cure)
    matrices = []
    for k, (frame, matrix) in enumerate(zip(frames, terms, strict=True)):
        turn = frame.find_matrix(epochs.at(k), states[k : k + 1], orientation)[0]
        matrices.append(turn @ matrix @ turn.T)
    return CovarianceHistory(label, where, reference, epochs, np.array(matrices))


def _split_blocks(message: CcsdsMessage, segment: CcsdsSegment) -> list[tuple[KeywordBlock, list[tuple[int, str]]]]:
    """Split the lines of the covariances of a segment at each EPOCH: keywords, and words of the rows of numbers."""
    blocks: list[tuple[KeywordBlock, list[tuple[int, str]]]] = []
    for line, text in segment.covariances:
        match = KEYWORD.fullmatch(text)
        if match is not None and match[1] == "EPOCH":
            blocks.append((KeywordBlock(message.where, f"the covariance of line {line}"), []))
        if not blocks:
            raise ScenarioError(f"{message.where}: line {line}: '{text:.40}' before EPOCH, which begins a covariance")
        if match is not None:
            blocks[-1][0].add(match[1], StatedValue(match[2], line, (match[3] or "").strip()))
        else:
            blocks[-1][1].extend((line, word) for word in text.split())
    return blocks


def _read_terms(block: KeywordBlock, words: list[tuple[int, str]]) -> np.ndarray:
    """Read a covariance (6, 6) from its lower triangle, row by row or by keywords [m2, m2/s, m2/s2]."""
    if words and len(words) != len(_TERMS):
        raise ScenarioError(
            f"{block.where}: line {words[-1][0]}: {block.part} has {len(words)} numbers; give the {len(_TERMS)} of the "
            "lower triangle, row by row"
        )
    for key, (line, word) in zip(_TERMS, words, strict=False):
        parse_number(f"{block.where}: line {line}", key, word, GREATEST_TERM)
        block.add(key, StatedValue(word, line))
    return read_triangle(block)
