"""A writer killed at any moment leaves a complete file, or only a temporary one whose frames are whole."""

import multiprocessing
import os
import signal
import sys
import time

import numpy as np
import pytest
from frames_for_tests import SOURCE, assert_same, datasets, make_frame, make_frames

from rso_lidar import export

COUNT, SHAPE, KILLS = 60, (24, 20), 15


def fly(path, told):
    """Write frames, going on where an earlier run was killed, and tell of each."""
    with export.Recorder(path, SOURCE, run_id="1a2b3c4d", resume=True) as recorder:
        for k in range(recorder.written, COUNT):
            recorder.write(make_frame(k, shape=SHAPE))
            told.send(k)


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX")
def test_kills_lose_no_whole_frame_and_resume_ends_like_an_unbroken_run(tmp_path):
    rng = np.random.default_rng(1807)
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["frames_for_tests", "rso_lidar.export", "h5py"])
    output, left = tmp_path / "run.h5", tmp_path / "run.h5.tmp-1a2b3c4d"
    told = -1
    middles = 0
    for _ in range(KILLS):
        listen, speak = processes.Pipe(duplex=False)
        child = processes.Process(target=fly, args=(output, speak))
        child.start()
        speak.close()
        for _ in range(rng.integers(0, 4)):  # let some frames pass (with 0: kill while it starts or copies) ...
            if listen.poll(30):
                told = max(told, listen.recv())
        time.sleep(rng.uniform(0, 0.01))  # ... and strike anywhere within the next few
        os.kill(child.pid, signal.SIGKILL)
        child.join()
        while listen.poll():
            try:
                told = max(told, listen.recv())
            except EOFError:
                break
        listen.close()
        assert not output.exists()
        if not left.exists():
            assert told == -1  # killed before the first frame
            continue
        with export.open(left) as recording:
            assert len(recording) >= told + 1  # what was told as written is there
            middles += 0 < len(recording) < COUNT
            for k, frame in enumerate(recording):
                assert_same(frame, make_frame(k, shape=SHAPE))
    assert middles > KILLS / 3
    with export.Recorder(output, SOURCE, run_id="1a2b3c4d", resume=True) as recorder:
        assert recorder.written > 0
        for k in range(recorder.written, COUNT):
            recorder.write(make_frame(k, shape=SHAPE))
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]
    whole = export.save(tmp_path / "whole.h5", make_frames(COUNT, shape=SHAPE))
    assert datasets(output) == datasets(whole)
