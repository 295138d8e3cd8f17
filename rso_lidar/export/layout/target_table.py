"""Tables of the targets of a recording, as JSON holds them, and the targets read back from such tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

from rso_lidar.records import Keypoint, TargetEntry, Taxonomy


def tabulate_targets(targets: Iterable[TargetEntry]) -> list[dict[str, Any]]:
    """Return each target as a table that JSON can hold."""
    return [
        {field.name: getattr(target, field.name) for field in dataclasses.fields(target)}
        | {
            "taxonomy": target.taxonomy.model_dump() if target.taxonomy else None,
            "keypoints": [point.model_dump(exclude_none=True) for point in target.keypoints],
        }
        for target in targets
    ]


def read_targets(tables: Iterable[Mapping[str, Any]]) -> tuple[TargetEntry, ...]:
    """Return the targets that a file holds as tables; older files lack taxonomy, part classes or keypoints."""
    return tuple(
        TargetEntry(
            **{
                **table,
                "parts": tuple(table["parts"]),
                "materials": tuple(table["materials"]),
                "taxonomy": Taxonomy(**table["taxonomy"]) if table.get("taxonomy") else None,
                "part_classes": tuple(table.get("part_classes", ())),
                "keypoints": tuple(Keypoint(**point) for point in table.get("keypoints", ())),
            }
        )
        for table in tables
    )
