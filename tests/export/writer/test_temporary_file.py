"""What other programs do to a recording under way: the run stops at the next frame, publishes nothing, keeps its frames."""

import os
import re
import shutil
from pathlib import Path

import pytest
from frames_for_tests import SOURCE, assert_same, datasets, folder_of_somebody, make_frame, make_frames

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.writer.temporary_file import TemporaryFile

RUN, COUNT, SHAPE = "1a2b3c4d", 4, (6, 5)
pytestmark = pytest.mark.skipif(os.name != "posix", reason="an open file cannot be moved or replaced elsewhere")


def record(output, meddle, at, **how):
    """Record some frames; before frame `at`, or after the last one, do something to the temporary file."""
    with export.Recorder(output, SOURCE, run_id=RUN, **how) as recorder:
        for k in range(recorder.written, COUNT):
            if k == at:
                meddle(recorder.temporary)
            recorder.write(make_frame(k, shape=SHAPE))
        if at == COUNT:
            meddle(recorder.temporary)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """Return the datasets of a run that nothing disturbs."""
    return datasets(export.save(tmp_path_factory.mktemp("unbroken") / "whole.h5", make_frames(COUNT, shape=SHAPE)))


def remove_folder(file):
    shutil.rmtree(file.parent)


def move_folder(file):
    file.parent.rename(file.parent.with_name("moved"))


def change_folder(file):
    move_folder(file)
    file.parent.mkdir()


def move(file):
    file.rename(file.with_name("elsewhere.h5.tmp-00000000"))


def remove(file):
    file.unlink()


def replace_by_text(file):
    file.unlink()
    file.write_text("garbage" * 1000)


def replace_by_recording(file):
    other = export.save(file.with_name("other.h5"), make_frames(2, shape=SHAPE, seed=2))
    other.rename(file)


def replace_by_link(file):
    whole = file.read_bytes()
    file.unlink()
    file.with_name("victim").write_bytes(whole)
    file.symlink_to("victim")


MEDDLING = [
    remove_folder,
    move_folder,
    change_folder,
    move,
    remove,
    replace_by_text,
    replace_by_recording,
    replace_by_link,
]


@pytest.mark.parametrize(
    ("meddle", "at"),
    [
        *((meddle, 2) for meddle in MEDDLING),
        *((meddle, COUNT) for meddle in (move_folder, remove, replace_by_recording)),
    ],
    ids=lambda value: {2: "in the middle", COUNT: "at the end"}.get(value) or value.__name__,
)
def test_frames_of_a_file_that_is_moved_or_replaced_are_kept(tmp_path, unbroken, meddle, at):
    output = tmp_path / "out" / "run.h5"
    output.parent.mkdir()
    with pytest.raises(
        RunError, match=rf"run\.h5: cannot be written after {at} frames \(.* (removed|replaced)"
    ) as caught:
        record(output, meddle, at)
    assert not output.exists()
    line = str(caught.value)
    assert "\n" not in line
    assert "make room" not in line
    if meddle is remove:
        assert line.endswith(f"run.h5.tmp-{RUN} is kept: keep other programs away from it and continue with --resume")
        kept = output.with_name(f"run.h5.tmp-{RUN}")
    else:
        found = re.search(r"kept in (\S+): (?:rename it to (\S+) and )?continue with -o (\S+) --resume$", line)
        kept, name, again = Path(found[1]), found[2], Path(found[3])
        if meddle in (remove_folder, move_folder):
            assert name is None
        if name is not None:  # the advice is followed: nothing is in its way
            assert not kept.with_name(name).exists()
            kept = kept.rename(kept.with_name(name))
        assert kept == again.with_name(f"{again.name}.tmp-{RUN}")
    assert kept.is_relative_to(tmp_path)
    with export.open(kept) as recording:
        assert len(recording) == at
        for k, frame in enumerate(recording):
            assert_same(frame, make_frame(k, shape=SHAPE))
    again = kept.with_name(kept.name.removesuffix(f".tmp-{RUN}"))
    record(again, None, None, resume=True)
    assert datasets(again) == unbroken


@pytest.mark.parametrize("at", [1, COUNT], ids=["in the middle", "at the end"])
@pytest.mark.parametrize("left_bytes", [0, 5000])
def test_a_file_cut_short_is_not_published(tmp_path, left_bytes, at):
    output = tmp_path / "run.h5"
    with pytest.raises(
        RunError, match=rf"after {at} frames \(run.h5.tmp-{RUN} was cut short.* could not be kept"
    ) as caught:
        record(output, lambda file: os.truncate(file, left_bytes), at)
    assert "make room" not in str(caught.value)
    assert not output.exists()
    record(output, None, None, overwrite=True)
    assert len(export.open(output)) == COUNT


def test_what_does_not_read_back_is_not_published(tmp_path):
    """Overwritten in place, at the same length, by other bytes."""

    def garble(file):
        size = file.stat().st_size
        with file.open("r+b") as stream:
            stream.seek(size // 2)
            stream.write(os.urandom(size // 2))

    output = tmp_path / "run.h5"
    with pytest.raises(RunError, match=r"run\.h5: not written: \S+ is not what was recorded \(.*damaged") as caught:
        record(output, garble, COUNT)
    assert "\n" not in str(caught.value)
    assert not output.exists()


def test_a_folder_turned_read_only_stops_the_run_at_the_next_frame(unbroken):
    with folder_of_somebody() as folder:
        output = folder / "run.h5"
        with pytest.raises(RunError, match=r"after 2 frames \(the folder .* may no longer be written to\)") as caught:
            record(output, lambda _: folder.chmod(0o500), 2)
        folder.chmod(0o700)
        assert str(caught.value).endswith(
            f"run.h5.tmp-{RUN} is kept: allow writing there again and continue with --resume"
        )
        record(output, None, None, resume=True)
        assert datasets(output) == unbroken


@pytest.mark.parametrize("victim", [b"precious", None], ids=["file", "nothing"])
def test_nothing_is_written_through_a_link(tmp_path, victim):
    aim = tmp_path / "aim"
    if victim is not None:
        aim.write_bytes(victim)
    output = tmp_path / "out" / "run.h5"
    output.parent.mkdir()
    (output.parent / f"run.h5.tmp-{RUN}.starting").symlink_to(aim)
    record(output, None, None)
    assert len(export.open(output)) == COUNT
    assert (aim.read_bytes() if aim.exists() else None) == victim
    assert [path.name for path in output.parent.iterdir()] == ["run.h5"]


def test_a_copy_goes_neither_over_a_file_nor_through_a_link(tmp_path):
    """The nearest folder that is there first; where its names are taken, the next one."""
    output = tmp_path / "run.h5"
    file = tmp_path / "run.h5.tmp-00"
    with file.open("x+b") as stream:
        stream.write(b"frames")
        stream.flush()
        temporary = TemporaryFile(file, stream.fileno())
    file.unlink()
    file.symlink_to("aim")
    kept = temporary.keep(output)
    assert kept == tmp_path / "run.rescued.h5.tmp-00"
    assert kept.read_bytes() == b"frames"
    assert not (tmp_path / "aim").exists()
    other = temporary.keep(output)
    assert other.parent != tmp_path
    assert other.read_bytes() == b"frames"
    other.unlink()
    temporary.close()


def test_without_any_frame_there_is_nothing_to_keep(tmp_path):
    output = tmp_path / "out" / "run.h5"
    output.parent.mkdir()
    with pytest.raises(
        RunError, match=r"after 0 frames \(No such file or directory\); create its folder again and run"
    ):
        record(output, remove_folder, 0)
    with pytest.raises(RecordingError, match="there is no folder"):
        record(output, None, None)
