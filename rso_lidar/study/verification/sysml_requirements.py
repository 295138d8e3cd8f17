"""Requirements as `requirement` and `verification` usages in the textual notation of SysML v2."""

from __future__ import annotations

from rso_lidar.mission_analysis import (
    SYSML_MISSION,
    ParameterTable,
    declare_attribute,
    quote_name,
    write_comment,
)
from rso_lidar.study.verification.matrix import describe_conditions
from rso_lidar.study.verification.requirements_file import Requirement, Requirements

_METHODS = {"analysis": "analyze", "test": "test", "inspection": "inspect", "demonstration": "demo"}


def write_requirements(asked: Requirements, parameters: ParameterTable) -> list[str]:
    """Write requirements as lines of a package whose part `mission` holds the parameters.

    A requirement on a parameter bounds the attribute of the mission. Another quantity becomes an attribute of the
    requirement, to be bound to a result.

    Parameters
    ----------
    asked : the requirements
    parameters : of the mission

    Returns
    -------
    list of str
        Lines for `ParameterTable.save` and `ParameterTable.sysml_text`.

    Raises
    ------
    ScenarioError
        For a requirement on a parameter that the mission does not have.
    """
    lines = []
    for one in asked.requirement:
        lines += _write_requirement(one, parameters)
        lines += _write_verification(one)
    return lines


def _write_requirement(one: Requirement, parameters: ParameterTable) -> list[str]:
    """Write the requirement usage."""
    if one.what.kind == "parameter":
        unit = parameters.find(one.quantity).unit
        value = ".".join(["lidar_mission", *(quote_name(step) for step in one.quantity.split("."))])
        declared = []
    else:
        unit, value = one.what.unit, "quantity"
        conditions = describe_conditions(one)
        meaning = f"{one.quantity}{f', {conditions}' if conditions else ''}. Unit: {unit}."
        declared = [f"{declare_attribute('quantity', unit)} {{ {write_comment(meaning)} }}"]
    limits, checks = [], []
    least, most = one.limits
    for name, limit, sign in (("at_least", least, ">="), ("at_most", most, "<=")):
        if abs(limit) != float("inf"):
            limits.append(f"{declare_attribute(name, unit, float(limit))};")
            checks.append(f"{value} {sign} {name}")
    if one.confidence is not None:
        limits.append(f"attribute confidence : Real = {one.confidence!r};")
    reasons = [f"{word}: {text}" for word, text in (("Rationale", one.rationale), ("Source", one.source)) if text]
    return [
        f"requirement <{quote_name(one.id)}> {quote_name(f'{one.id} {one.quantity}')} {{",
        f"    {write_comment(one.text)}",
        *(f"    comment /* {' '.join(text.split()).replace('*/', '* /')} */" for text in reasons),
        f"    subject lidar_mission :> {SYSML_MISSION};",
        *(f"    {line}" for line in (*declared, *limits)),
        f"    require constraint {{ {' and '.join(checks)} }}",
        "}",
    ]


def _write_verification(one: Requirement) -> list[str]:
    """Write the verification case of a requirement, with its method."""
    return [
        f"verification {quote_name(f'verify {one.id}')} {{",
        f"    @VerificationMethod {{ kind = VerificationMethodKind::{_METHODS[one.verification]}; }}",
        f"    subject lidar_mission :> {SYSML_MISSION};",
        f"    objective {{ verify {quote_name(f'{one.id} {one.quantity}')}; }}",
        "}",
    ]
