"""A recording from a stranger: data in other files of the machine are refused, before they are read."""

import h5py
import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError
from rso_lidar.export import check_self_contained


def link_externally(file, secret):
    file["labels"] = h5py.ExternalLink(str(secret), "/")


def store_raw(file, secret):
    file.create_dataset("range_m", (4,), "u1", external=[(str(secret), 0, 4)])


def map_virtually(file, secret):
    layout = h5py.VirtualLayout((4,), "u1")
    layout[:] = h5py.VirtualSource(str(secret), "a", (4,))
    file.create_group("deep").create_virtual_dataset("range_m", layout)


@pytest.mark.parametrize("hide", [link_externally, store_raw, map_virtually])
def test_data_in_another_file_are_refused_by_name(tmp_path, hide):
    path, secret = tmp_path / "a.h5", tmp_path / "secret.h5"
    with h5py.File(path, "w") as file:
        file["time_s"] = np.arange(3.0)
        hide(file, secret)
    with pytest.raises(RecordingError, match=r"a\.h5: '/\S+' is in another file, '.*secret\.h5'; export it again"):
        check_self_contained(path)


def test_a_file_with_its_own_data_passes(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["deep/er/time_s"] = np.arange(3.0)
        file["soft"] = h5py.SoftLink("/deep/er/time_s")
        file["loop"] = h5py.SoftLink("/")
        layout = h5py.VirtualLayout((3,), "f8")
        layout[:] = h5py.VirtualSource(file["deep/er/time_s"])
        file.create_virtual_dataset("own", layout)
    check_self_contained(tmp_path / "a.h5")
    with pytest.raises(RecordingError, match="no such file"):
        check_self_contained(tmp_path / "b.h5")


def test_a_recording_that_is_open_already_passes(tmp_path, text):
    rl.save(tmp_path / "a.h5", rl.simulate(rl.Scenario.loads(text), frames=[0]))
    with rl.open(tmp_path / "a.h5") as recording:
        check_self_contained(tmp_path / "a.h5")
        assert len(recording) == 1


def test_groups_that_contain_each_other_end(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        inner = file.create_group("inner")
        inner["outer"] = file["/"]  # a hard link: the groups contain each other without end
    with pytest.raises(RecordingError, match="more than 10,000 objects"):
        check_self_contained(tmp_path / "a.h5")
