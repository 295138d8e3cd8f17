"""Requests of flight software, as parts: their keys with units and bounds, and the parser of a request."""

from __future__ import annotations

import json
from collections import Counter
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.part import Flag, Name, NotNegative, Number, Part, Positive, Text, Whole, explain
from rso_lidar.records import Command

SCHEMA = {"name": "rso_lidar.loop", "version": 1}
_MOST_SEQUENCE = 2**53  # an integer in the numbers of JavaScript
GREATEST_NS = 2**62  # 146 years, and a 64-bit integer in every language

Nanoseconds = Annotated[Whole, Field(ge=0, le=GREATEST_NS)]


class CommandRequest(Part):
    """A command, as `rl.Command`: what is left out, or null, is the scenario's."""

    pan_rad: Number | None = Field(default=None, description="Pan of the PTU; positive to the left [rad].")
    tilt_rad: Number | None = Field(default=None, description="Tilt of the PTU; positive upward [rad].")
    focal_length_m: Positive | None = Field(default=None, description="Focal length of a zoom lens [m].")
    divergence_rad: Positive | None = Field(default=None, description="Full divergence of an actuated diffuser [rad].")
    energy_j: Positive | None = Field(default=None, description="Energy of one pulse [J].")
    gate_delay_s: NotNegative | None = Field(default=None, description="Two-way delay at which a range gate opens [s].")
    inputs: dict[str, Annotated[tuple[Number, ...], Field(max_length=1000)]] | None = Field(
        default=None, description="Inputs u of state-space models, by the name of the body, each in its own unit."
    )

    def to_command(self) -> Command:
        """Return the record of this command."""
        return Command(**vars(self))


class Request(Part):
    """Keys of every request."""

    request: str = Field(description="Kind of the request.")
    sequence: Annotated[Whole, Field(ge=0, le=_MOST_SEQUENCE)] = Field(
        default=0, description="Number of the request, of the client's choice; the reply repeats it."
    )


class HelloRequest(Request):
    """Opens the session of a client: the first request on every connection."""

    request: Literal["hello"] = Field(description="Kind of the request.")
    version: Literal[1] = Field(description="Version of the schema that the client uses.")
    role: Literal["driver", "observer"] = Field(
        default="driver", description="A driver steps the simulation; there is one at a time. An observer only reads."
    )
    head: Literal["json", "struct"] = Field(
        default="json", description="Head of the replies to this client: JSON, or structures of C."
    )
    cameras: tuple[Name, ...] | Literal["all"] = Field(
        default=(),
        description='Cameras beside the lidar whose images the replies to this client hold: their names, or `"all"`.',
    )
    client: Annotated[Text, Field(max_length=100)] = Field(default="?", description="Name for the server's log.")
    token: Annotated[Text, Field(max_length=1000)] | None = Field(
        default=None, description="Secret of a server that was started with one."
    )


class DescribeRequest(Request):
    """Requests what does not change: times, pixels, PTU and link, and the line of sight of the pixels."""

    request: Literal["describe"] = Field(description="Kind of the request.")


class StepRequest(Request):
    """Steps to the next flash, or by a time, under a command."""

    request: Literal["step"] = Field(description="Kind of the request.")
    command: CommandRequest | None = Field(default=None, description="Command; null or left out is an empty one.")
    dt_ns: Annotated[Whole, Field(ge=1, le=10**18)] | None = Field(
        default=None, description="Length of the step [ns]; null or left out: to the next flash."
    )
    stamp_ns: Nanoseconds | None = Field(
        default=None,
        description="When the command was given, since start_utc [ns]; null or left out: as soon as it could have been.",
    )


class ResetRequest(Request):
    """Resets the simulation to t = 0, before the first flash."""

    request: Literal["reset"] = Field(description="Kind of the request.")
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] | None = Field(
        default=None, description="Seed of all noise; null or left out: the scenario's."
    )


class ObservationRequest(Request):
    """Requests the latest reading again."""

    request: Literal["observation"] = Field(description="Kind of the request.")


class TruthRequest(Request):
    """Requests the true poses at the present time, from a server that was started with --truth."""

    request: Literal["truth"] = Field(description="Kind of the request.")


class SaveRequest(Request):
    """Saves the present state on the server; the reply holds its name."""

    request: Literal["save"] = Field(description="Kind of the request.")


class RestoreRequest(Request):
    """Restores a state that was saved on the server."""

    request: Literal["restore"] = Field(description="Kind of the request.")
    state: Text = Field(description="Name of the state, from the reply to `save`.")
    delete: Flag = Field(default=False, description="Whether the server deletes the state afterwards.")


class ShutdownRequest(Request):
    """Ends the server; a recording is completed."""

    request: Literal["shutdown"] = Field(description="Kind of the request.")


REQUESTS: dict[str, type[Request]] = {
    "hello": HelloRequest,
    "describe": DescribeRequest,
    "step": StepRequest,
    "reset": ResetRequest,
    "observation": ObservationRequest,
    "truth": TruthRequest,
    "save": SaveRequest,
    "restore": RestoreRequest,
    "shutdown": ShutdownRequest,
}


def parse_request(header: bytes) -> Any:
    """Return the request that a header holds; raise `ScenarioError` if it is no JSON object, or no request.

    Parameters
    ----------
    header : UTF-8 text of a JSON object
    """
    tree = parse_json(header, "request")
    kind = tree.get("request")
    if not isinstance(kind, str) or kind not in REQUESTS:
        known = ", ".join(REQUESTS)
        guess = did_you_mean(kind, REQUESTS) if isinstance(kind, str) else ""
        raise ScenarioError(f"request: {kind!r:.60} is not known{guess} (known: {known})")
    try:
        return REQUESTS[kind].model_validate(tree)
    except ValidationError as error:
        raise ScenarioError(f"{kind}: {explain(error, REQUESTS[kind], tree)}") from None


def find_sequence(header: bytes) -> int:
    """Return the number of a request that may be invalid otherwise, so that its refusal can repeat it; 0 for none."""
    try:
        number = parse_json(header, "request").get("sequence")
    except ScenarioError:
        return 0
    return number if type(number) is int and 0 <= number <= _MOST_SEQUENCE else 0


def parse_json(text: bytes, where: str) -> dict[str, Any]:
    """Return the JSON object of a text.

    Parameters
    ----------
    text : UTF-8

    Raises
    ------
    ScenarioError
        If it is no JSON object, holds NaN or an infinity, or a key twice.
    """
    try:
        tree = _DECODER.decode(text.decode())
    except RecursionError:
        raise ScenarioError(f"{where}: is nested too deeply; send a flat JSON object") from None
    except ValueError as error:  # of JSON and of UTF-8
        raise ScenarioError(f"{where}: is not JSON in UTF-8 ({error!s:.100}); send a JSON object") from None
    if not isinstance(tree, dict):
        raise ScenarioError(f"{where}: is {type(tree).__name__} and not an object; send a JSON object")
    return tree


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is no JSON number")


def _join_pairs(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    joined = dict(pairs)
    if len(joined) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {twice!r:.40} occurs twice")
    return joined


_DECODER = json.JSONDecoder(parse_constant=_refuse_constant, object_pairs_hook=_join_pairs)
