"""Parts: the frozen base of all that a user describes, with its TOML text, its messages and checks of users' objects."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.part.field_types import describe_type
    from rso_lidar.part.model import (
        GREATEST,
        NAME_PATTERN,
        UNIT_NORM_WITHIN,
        Count,
        Direction,
        Flag,
        Fraction,
        Instant,
        Name,
        NotNegative,
        Number,
        Part,
        Positive,
        Quaternion,
        Seam,
        Text,
        Vector,
        Whole,
        dump_part,
        kind_of,
        name_object,
        python_objects,
    )
    from rso_lidar.part.toml_text import DEEPEST_TOML, MOST_TOML_BYTES, parse_toml
    from rso_lidar.part.user_objects import (
        call_member,
        check_lines,
        check_text,
        check_values,
        lock_array,
        make_answer_error,
        read_member,
        to_real_array,
    )
    from rso_lidar.part.validation_messages import explain, part_classes, show_value
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "DEEPEST_TOML",
    "GREATEST",
    "MOST_TOML_BYTES",
    "NAME_PATTERN",
    "UNIT_NORM_WITHIN",
    "Count",
    "Direction",
    "Flag",
    "Fraction",
    "Instant",
    "Name",
    "NotNegative",
    "Number",
    "Part",
    "Positive",
    "Quaternion",
    "Seam",
    "Text",
    "Vector",
    "Whole",
    "call_member",
    "check_lines",
    "check_text",
    "check_values",
    "describe_type",
    "dump_part",
    "explain",
    "kind_of",
    "lock_array",
    "make_answer_error",
    "name_object",
    "parse_toml",
    "part_classes",
    "python_objects",
    "read_member",
    "show_value",
    "to_real_array",
]

__dir__ = limit_dir(__name__)
