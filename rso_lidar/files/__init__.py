"""Files: read whole and within bounds, written whole or not at all, and locked while they are written."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.files.array_files import read_array, read_arrays
    from rso_lidar.files.locks import hold_lock, is_locked
    from rso_lidar.files.reading import (
        MOST_BYTES,
        check_regular,
        convert_path,
        count_bytes,
        describe_size,
        expand_user,
        explain_unreadable,
        read_bytes,
        read_text,
    )
    from rso_lidar.files.writing import (
        advise_on_write,
        align_columns,
        can_write_in,
        check_draft,
        check_stream,
        check_suffix,
        check_writable,
        format_csv,
        is_same,
        make_write_error,
        write_atomically,
        write_columns,
        write_text,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "MOST_BYTES",
    "advise_on_write",
    "align_columns",
    "can_write_in",
    "check_draft",
    "check_regular",
    "check_stream",
    "check_suffix",
    "check_writable",
    "convert_path",
    "count_bytes",
    "describe_size",
    "expand_user",
    "explain_unreadable",
    "format_csv",
    "hold_lock",
    "is_locked",
    "is_same",
    "make_write_error",
    "read_array",
    "read_arrays",
    "read_bytes",
    "read_text",
    "write_atomically",
    "write_columns",
    "write_text",
]

__dir__ = limit_dir(__name__)
