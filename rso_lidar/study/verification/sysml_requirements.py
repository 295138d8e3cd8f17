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
    for requirement in asked.requirement:
        lines += _write_requirement(requirement, parameters)
        lines += _write_verification(requirement)
    return lines


def _write_requirement(requirement: Requirement, parameters: ParameterTable) -> list[str]:
    """Write the requirement usage."""
    if requirement.what.kind == "parameter":
        unit = parameters.find(requirement.quantity).unit
        value = ".".join(["lidar_mission", *(quote_name(step) for step in requirement.quantity.split("."))])
        declared = []
    else:
        unit, value = requirement.what.unit, "quantity"
        conditions = describe_conditions(requirement)
        meaning = f"{requirement.quantity}{f', {conditions}' if conditions else ''}. Unit: {unit}."
        declared = [f"{declare_attribute('quantity', unit)} {{ {write_comment(meaning)} }}"]
    limits, checks = [], []
    least, most = requirement.limits
    for name, limit, sign in (("at_least", least, ">="), ("at_most", most, "<=")):
        if abs(limit) != float("inf"):
            limits.append(f"{declare_attribute(name, unit, float(limit))};")
            checks.append(f"{value} {sign} {name}")
    if requirement.confidence is not None:
        limits.append(f"attribute confidence : Real = {requirement.confidence!r};")
    reasons = [
        f"{word}: {text}"
        for word, text in (("Rationale", requirement.rationale), ("Source", requirement.source))
        if text
    ]
    return [
        f"requirement <{quote_name(requirement.id)}> {quote_name(f'{requirement.id} {requirement.quantity}')} {{",
        f"    {write_comment(requirement.text)}",
        *(f"    comment /* {' '.join(text.split()).replace('*/', '* /')} */" for text in reasons),
        f"    subject lidar_mission :> {SYSML_MISSION};",
        *(f"    {line}" for line in (*declared, *limits)),
        f"    require constraint {{ {' and '.join(checks)} }}",
        "}",
    ]


def _write_verification(requirement: Requirement) -> list[str]:
    """Write the verification case of a requirement, with its method."""
    return [
        f"verification {quote_name(f'verify {requirement.id}')} {{",
        f"    @VerificationMethod {{ kind = VerificationMethodKind::{_METHODS[requirement.verification]}; }}",
        f"    subject lidar_mission :> {SYSML_MISSION};",
        f"    objective {{ verify {quote_name(f'{requirement.id} {requirement.quantity}')}; }}",
        "}",
    ]
