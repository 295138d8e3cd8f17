"""Folders for `ros2 bag play`: the MCAP file of a recording, and the metadata.yaml of rosbag2.

The metadata has version 5 (Humble), which later releases read too.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from rso_lidar.export.formats.mcap import MessageSpan, check_mcap, write_messages
from rso_lidar.export.writer.folders import MARK, check_export_folder, draft_export_folder
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.records import Frame

METADATA = "metadata.yaml"


def write_rosbag2(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write a folder that ROS 2 plays: the MCAP file of `write_mcap` and its metadata. Return its path."""
    place = check_export_folder(path, overwrite=overwrite)
    check_mcap(place)
    first, coming = take_first(place, frames)
    name = f"{place.stem}_0.mcap"
    with draft_export_folder(place, overwrite=overwrite) as draft:
        written = write_messages(place, draft / name, first, coming)
        version = first.source.versions.get("rso_lidar", "")
        (draft / METADATA).write_text(f"# {MARK}: {version}\n{_format_metadata(name, written)}", encoding="utf-8")
    return place


def _format_metadata(name: str, written: MessageSpan) -> str:
    """Return the metadata as YAML; a text in JSON's quotes is valid YAML."""
    start, lasts = written.first_ns, written.last_ns - written.first_ns
    count = sum(written.counts.values())
    lines = [
        "rosbag2_bagfile_information:",
        "  version: 5",
        "  storage_identifier: mcap",
        f"  duration: {{nanoseconds: {lasts}}}",
        f"  starting_time: {{nanoseconds_since_epoch: {start}}}",
        f"  message_count: {count}",
        '  compression_format: ""',
        '  compression_mode: ""',
        f"  relative_file_paths: [{json.dumps(name)}]",
        "  files:",
        f"    - path: {json.dumps(name)}",
        f"      starting_time: {{nanoseconds_since_epoch: {start}}}",
        f"      duration: {{nanoseconds: {lasts}}}",
        f"      message_count: {count}",
        "  topics_with_message_count:",
    ]
    for topic, kind in written.kinds.items():
        lines += [
            "    - topic_metadata:",
            f"        name: {topic}",
            f"        type: {kind}",
            "        serialization_format: cdr",
            '        offered_qos_profiles: ""',
            f"      message_count: {written.counts[topic]}",
        ]
    return "\n".join(lines) + "\n"
