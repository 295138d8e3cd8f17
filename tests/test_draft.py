import pytest

from rso_lidar.draft import beside
from rso_lidar.errors import RecordingError, RunError


def test_what_stops_half_way_leaves_the_old_picture(tmp_path):
    place = tmp_path / "a.png"
    place.write_text("old")

    def stop(error):
        with beside(place) as draft:
            draft.write_text("half")
            raise error

    with pytest.raises(KeyboardInterrupt):
        stop(KeyboardInterrupt())
    with pytest.raises(RunError, match="could not be written: No space left"):
        stop(OSError(28, "No space left on device"))
    with pytest.raises(RecordingError, match="may not be written"):
        stop(PermissionError(13, "Permission denied"))
    assert place.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_draft_is_nobody_elses_file(tmp_path):
    place = tmp_path / "a.png"
    own = [tmp_path / "a.part.png", tmp_path / "a.part1.png"]
    for path in own:
        path.write_text("mine")
    with beside(place) as draft:
        assert draft.suffix == ".png"
        assert draft not in own
        with beside(place) as another:  # at the same time
            assert another not in (draft, *own)
            another.write_text("second")
        draft.write_text("first")
    assert place.read_text() == "first"
    assert [path.read_text() for path in own] == ["mine", "mine"]
    with pytest.raises(RecordingError, match="there is no folder"), beside(tmp_path / "none" / "a.png"):
        raise AssertionError("begun")
    assert len(list(tmp_path.iterdir())) == 3


def test_a_folder_that_may_not_be_written_is_told(tmp_path, monkeypatch):
    def refused(path, *_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refused)
    with pytest.raises(RecordingError, match="may not be written"), beside(tmp_path / "a.png"):
        raise AssertionError("begun")
