"""The list of recordings: read again only where a file changed, without files that are no recordings of the folder."""

from dataclasses import replace

import h5py
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.studio.model import recording_list
from rso_lidar.studio.model.recording_list import RecordingList, open_recording
from rso_lidar.studio.model.root_folder import Folder


@pytest.fixture
def folder(tmp_path):
    scenario = rl.Scenario.load("examples/bench_plate.toml")
    rl.save(tmp_path / "a.h5", rl.simulate(scenario, frames=[0]))
    return Folder(tmp_path)


def test_files_are_read_again_only_when_they_change(folder, monkeypatch):
    listed, calls = RecordingList(folder), []
    read = recording_list.read_status
    monkeypatch.setattr(recording_list, "read_status", lambda path: calls.append(path.name) or read(path))
    assert [status.frames for status in listed.read()] == [1]
    assert [status.frames for status in listed.read()] == [1]
    assert calls == ["a.h5"]
    rl.save(
        folder.path / "a.h5", rl.simulate(rl.Scenario.load("examples/bench_plate.toml"), frames=[0, 1]), overwrite=True
    )
    assert [status.frames for status in listed.read()] == [2]
    (folder.path / "a.h5").write_bytes(b"words")
    assert listed.read() == []
    assert "not an HDF5 file" in listed.problems[folder.path / "a.h5"]
    (folder.path / "a.h5").unlink()
    assert listed.read() == [] and not listed.problems


def test_links_and_files_that_take_data_from_elsewhere_are_left_out(folder, tmp_path_factory):
    secret = tmp_path_factory.mktemp("elsewhere") / "secret.h5"
    (folder.path / "a.h5").rename(secret)
    (folder.path / "b.h5.tmp-1a2b").symlink_to(secret)
    with h5py.File(folder.path / "c.h5", "w") as file:
        for name in ("time_s", "labels"):
            file[name] = h5py.ExternalLink(str(secret), f"/{name}")
    listed = RecordingList(folder)
    assert listed.read() == []
    assert [path.name for path in listed.problems] == ["c.h5"]
    with pytest.raises(RecordingError, match=r"in another file|not a recording"):
        open_recording(folder, "c.h5")
    with pytest.raises(ScenarioError, match="inside the folder"):
        open_recording(folder, "../secret.h5")


def test_a_run_that_ends_while_it_is_opened_is_complete(folder, monkeypatch):
    """Between the look at the folder and the opening of the file, the run gives the file its final name."""
    ended = recording_list.read_status(folder.path / "a.h5")
    before = replace(ended, file=folder.path / "a.h5.tmp-1a2b3c4d", running=True, complete=False)
    looks = iter([before, ended])
    monkeypatch.setattr(recording_list, "read_status", lambda path: next(looks))
    recording, is_running = open_recording(folder, "a.h5")
    with recording:
        assert len(recording) == 1 and not is_running
    monkeypatch.setattr(recording_list, "read_status", lambda path: before)
    with pytest.raises(RecordingError, match="there is no such file"):
        open_recording(folder, "a.h5")


def test_the_table_has_a_row_for_each_recording_and_then_those_not_read(folder):
    (folder.path / "0.h5").write_bytes(b"words")
    size = f"{(folder.path / 'a.h5').stat().st_size / 1e6:.1f}"
    assert RecordingList(folder).tabulate() == [
        {"name": "a.h5", "frames": 1, "state": "complete", "size": size},
        {"name": "0.h5", "frames": "", "state": "cannot be read", "size": ""},
    ]
