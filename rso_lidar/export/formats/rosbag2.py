"""A folder for `ros2 bag play`: the MCAP file of the recording, and the metadata.yaml that rosbag2 reads first.

The metadata is of version 5 (Humble's), which later ones read too.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from rso_lidar.export.formats.mcap import TOPICS, Span, fill, needs_extra
from rso_lidar.export.writer.folders import MARK, folder_beside, free_folder
from rso_lidar.export.writer.frames import begun
from rso_lidar.records import Frame

METADATA = "metadata.yaml"


def write_rosbag2(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Return the path of a folder that ROS 2 plays: an MCAP file as `write_mcap` makes it, and what rosbag2 wants beside."""
    place = free_folder(path, overwrite=overwrite)
    needs_extra(place)
    first, coming = begun(place, frames)
    name = f"{place.stem}_0.mcap"
    with folder_beside(place, overwrite=overwrite) as draft:
        written = fill(place, draft / name, first, coming)
        version = first.source.versions.get("rso_lidar", "")
        (draft / METADATA).write_text(f"# {MARK}: {version}\n{_metadata(name, written)}", encoding="utf-8")
    return place


def _metadata(name: str, written: Span) -> str:
    """Return the metadata as YAML; a text in JSON's quotes is one in YAML's."""
    start, lasts = written.first_ns, written.last_ns - written.first_ns
    lines = [
        "rosbag2_bagfile_information:",
        "  version: 5",
        "  storage_identifier: mcap",
        f"  duration: {{nanoseconds: {lasts}}}",
        f"  starting_time: {{nanoseconds_since_epoch: {start}}}",
        f"  message_count: {written.frames * len(TOPICS)}",
        '  compression_format: ""',
        '  compression_mode: ""',
        f"  relative_file_paths: [{json.dumps(name)}]",
        "  files:",
        f"    - path: {json.dumps(name)}",
        f"      starting_time: {{nanoseconds_since_epoch: {start}}}",
        f"      duration: {{nanoseconds: {lasts}}}",
        f"      message_count: {written.frames * len(TOPICS)}",
        "  topics_with_message_count:",
    ]
    for topic, kind in TOPICS.items():
        lines += [
            "    - topic_metadata:",
            f"        name: {topic}",
            f"        type: {kind}",
            "        serialization_format: cdr",
            '        offered_qos_profiles: ""',
            f"      message_count: {written.frames}",
        ]
    return "\n".join(lines) + "\n"
