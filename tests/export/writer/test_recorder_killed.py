"""A writer killed at any moment leaves a complete file, or only a temporary one whose frames are whole."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from frames_for_tests import SOURCE, assert_same, assert_same_record, datasets, make_frame, make_frames

from rso_lidar import export
from rso_lidar.records import join_samples

COUNT, SHAPE, KILLS = 60, (24, 20), 6
PLAIN = "{}"
FULL = (
    '{"returns": True, "keep": ("waveforms", "photons", "oversampled"), "zoom": lambda k: 1.0 + k % 11, '
    '"sensors": {"gyro": (1, 5, 6, 5), "wheels": (0, 0, 2, 2), "own sensor": (0, 1, 0, 1)}}'
)

# Imports once, then forks a child for each line that it reads. A child writes frames, going on where an earlier one was
# killed, and tells of each through a pipe with a name. This process says which child began, and when it has ended.
FLY = f"""
import os, sys
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from frames_for_tests import SOURCE, make_frame
from rso_lidar import export
import h5py
for line in sys.stdin:
    output, pipe, kind = line.rstrip("\\n").split("\\t")
    child = os.fork()
    if child:
        print(child, flush=True)
        print(os.WTERMSIG(os.waitpid(child, 0)[1]), flush=True)
        continue
    how = eval(kind)
    with open(pipe, "w") as told:
        print("ready", file=told, flush=True)
        with export.Recorder(output, SOURCE, run_id="1a2b3c4d", resume=True, changing_lens="zoom" in how) as recorder:
            for k in range(recorder.written, {COUNT}):
                recorder.write(make_frame(k, shape={SHAPE}, **how))
                print(k, file=told, flush=True)
    os._exit(0)
"""


@pytest.fixture
def writers():
    """Return a process that starts writers, one for each test: what a failed test left unread is not the next one's."""
    command = [sys.executable, "-c", FLY]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1) as process:
        yield process
        process.stdin.close()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX")
@pytest.mark.parametrize("kind", [PLAIN, FULL], ids=["plain", "kept, lens and sensors"])
def test_kills_lose_no_whole_frame_and_resume_ends_like_an_unbroken_run(tmp_path, tmp_path_factory, writers, kind):
    how = eval(kind)
    rng = np.random.default_rng(1807)
    output, left = tmp_path / "run.h5", tmp_path / "run.h5.tmp-1a2b3c4d"
    pipe = tmp_path_factory.mktemp("pipes") / "told"
    os.mkfifo(pipe)
    told = -1
    middles = 0
    for _ in range(KILLS):
        writers.stdin.write(f"{output}\t{pipe}\t{kind}\n")
        child = int(writers.stdout.readline())
        assert child > 1  # os.kill takes 0 for the group of this process
        with pipe.open() as lines:
            assert lines.readline() == "ready\n"
            for _ in range(rng.integers(0, 4)):  # let some frames pass (with 0: kill while it starts or copies) ...
                told = max(told, int(lines.readline()))
            time.sleep(rng.uniform(0, 0.01))  # ... and strike anywhere within the next few
            os.kill(child, signal.SIGKILL)
            told = max([told, *(int(line) for line in lines if line.endswith("\n"))])
        assert int(writers.stdout.readline()) == signal.SIGKILL
        assert not output.exists()
        if not left.exists():
            assert told == -1  # killed before the first frame
            continue
        with export.open(left) as recording:
            assert len(recording) >= told + 1  # what was told as written is there
            middles += 0 < len(recording) < COUNT
            frames = [make_frame(k, shape=SHAPE, **how) for k in range(len(recording))]
            for frame, made in zip(recording, frames, strict=True):
                assert_same(frame, made)
            assert list(recording.sensors) == list(how.get("sensors", ()))
            for name, series in join_samples([made.observation.sensors for made in frames]).items():
                assert_same_record(recording.sensors[name], series)
    assert middles > KILLS / 3
    with export.Recorder(output, SOURCE, run_id="1a2b3c4d", resume=True, changing_lens="zoom" in how) as recorder:
        assert recorder.written > 0
        for k in range(recorder.written, COUNT):
            recorder.write(make_frame(k, shape=SHAPE, **how))
    # A kill between making and removing a probe, which shows that the folder can be written to, leaves an empty file.
    probes = list(tmp_path.glob("run.h5.tmp-*.probe"))
    assert all(probe.stat().st_size == 0 for probe in probes)
    assert sorted(tmp_path.iterdir()) == sorted([output, *probes])
    whole = export.save(tmp_path / "whole.h5", make_frames(COUNT, shape=SHAPE, **how))
    assert datasets(output) == datasets(whole)


def test_no_metadata_crosses_a_page_of_memory(tmp_path):
    """A kill can cut a write in two between pages: 2 of 637 killed writers lost frames where metadata crossed them."""
    output = export.save(tmp_path / "run.h5", make_frames(COUNT, shape=SHAPE))
    with h5py.File(output) as file:
        created = file.id.get_create_plist()
        assert created.get_file_space_strategy()[0] == h5py.h5f.FSPACE_STRATEGY_PAGE
        page_bytes = created.get_file_space_page_size()
    assert page_bytes == 4096  # of x86, and a divisor of all others
    content, headers = output.read_bytes(), 0
    place = content.find(b"OHDR")
    while place >= 0:  # version 2 of an object header: flags, four times of 4 bytes, its size, messages, a checksum
        flags = content[place + 5]
        skipped = 6 + 16 * bool(flags & 0x20) + 4 * bool(flags & 0x10)
        width = 1 << (flags & 3)
        end = place + skipped + width + int.from_bytes(content[place + skipped :][:width], "little") + 4
        assert place // page_bytes == (end - 1) // page_bytes
        headers, place = headers + 1, content.find(b"OHDR", end)
    assert headers >= 20
