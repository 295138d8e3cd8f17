"""The bytes of tables: encodings, and compression that is bounded."""

import gzip

import pytest

from rso_lidar import files
from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.passes.search_objects import collect_objects
from rso_lidar.orbit import read_table_text

TEXT = "time_s,x_km,y_km,z_km\n0,7000,0,0\n1,7000,7.5,0\n"


@pytest.mark.parametrize(
    "content",
    [
        TEXT.encode(),
        TEXT.encode("utf-8-sig"),
        TEXT.replace("\n", "\r").encode(),
        TEXT.replace("\n", "\r\n").encode(),
        TEXT.encode("utf-16"),
        b"\xfe\xff" + TEXT.encode("utf-16-be"),
        gzip.compress(TEXT.encode()),
        gzip.compress(TEXT[:20].encode()) + gzip.compress(TEXT[20:].encode()),
        gzip.compress(TEXT.encode("utf-16")),
    ],
    ids=[
        "utf-8",
        "mark",
        "cr",
        "crlf",
        "utf-16",
        "utf-16-be",
        "gzip",
        "two members",
        "utf-16 in gzip",
    ],  # gzip holds the time
)
def test_text_of_any_usual_encoding_is_read(tmp_path, content):
    path = tmp_path / "some.csv"
    path.write_bytes(content)
    assert read_table_text(path) == TEXT
    assert [entry.name for entry in collect_objects(str(path)).entries] == ["some"]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (TEXT.encode("utf-16-le"), "is not UTF-8 text, it contains NUL characters; save it as UTF-8"),
        (b"\xff\xfea", "is not UTF-16 text"),
        (b"\xe9t\xe9", "is not UTF-8 text; give the path"),
        (gzip.compress(TEXT.encode())[:-12], "is gzip that is cut short; copy it again"),
        (b"\x1f\x8b" + b"no gzip at all", "is damaged gzip"),
        (gzip.compress(b""), "is empty"),
    ],
    ids=["no mark", "half a letter", "latin-1", "cut gzip", "no gzip", "empty gzip"],
)
def test_what_is_no_text_is_refused_with_the_reason(tmp_path, content, says):
    path = tmp_path / "some.oem.gz"
    path.write_bytes(content)
    with pytest.raises(ScenarioError, match=says) as error:
        read_table_text(path)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)


def test_decompression_stops_at_the_limit_of_size(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MOST_BYTES", 2**20)
    path = tmp_path / "large.oem.gz"
    path.write_bytes(gzip.compress(b" " * (2**20 - 1) + b"a") + gzip.compress(b"b"))
    with pytest.raises(ScenarioError, match="holds more than 1 MiB after decompression; give a smaller file"):
        read_table_text(path)
    path.write_bytes(gzip.compress(b" " * (2**20 - 1) + b"a"))
    assert len(read_table_text(path)) == 2**20
