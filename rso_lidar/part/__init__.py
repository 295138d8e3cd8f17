"""Parts: the frozen base of all that a user describes, with its TOML text, its messages and checks of users' objects."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.part.model import (
        GREATEST,
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
    from rso_lidar.part.validation_messages import explain, show_value

__all__ = [
    "GREATEST",
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
    "dump_part",
    "explain",
    "kind_of",
    "lock_array",
    "make_answer_error",
    "name_object",
    "python_objects",
    "read_member",
    "show_value",
    "to_real_array",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
