"""Runs that break: a process that is killed and a disk that is full are said in words, and a resumed run is whole."""

import ctypes
import os
import signal
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.studio.browser.conftest import watch_pages
from tests.studio.browser.page_elements import (
    find,
    find_differences,
    find_input,
    find_recording,
    run_command_line,
)
from tests.studio.conftest import serve_studio

DISK_KB, REMOUNT = 700, 32  # flag of mount(2)
PROCESSES = Path("/proc/self/cmdline")


def find_run(folder):
    """Return the number of the process that records in a folder."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                if b"run" in words and (entry / "cwd").readlink() == folder:
                    return int(entry.name)
            except OSError:
                continue
    return None


@contextmanager
def mount_small_disk(place):
    """Mount a small file system at a folder, and yield a function that enlarges it.

    The test is skipped where that is not allowed.
    """
    if not PROCESSES.exists() or os.geteuid() != 0:
        pytest.skip("a small disk can be mounted by root of a Linux system only")
    library = ctypes.CDLL(None, use_errno=True)

    def mount(flags, size):
        return library.mount(b"tmpfs", os.fsencode(place), b"tmpfs", flags, f"size={size}k".encode()) == 0

    if not mount(0, DISK_KB):
        pytest.skip(f"a small disk cannot be mounted here: {os.strerror(ctypes.get_errno())}")
    try:
        yield lambda: mount(REMOUNT, 100 * DISK_KB)
    finally:
        library.umount2(os.fsencode(place), 2)  # even while a process uses it


def start(page, name, frames):
    """Start a run with the form of the page Run, without waiting for its end."""
    find(page, "page-run").click()
    page.get_by_label("Frames").fill(frames)
    page.get_by_label("Name of the result").fill(name)
    page.keyboard.press("Tab")
    find(page, "start").click()


@pytest.mark.skipif(not PROCESSES.exists(), reason="processes are found in /proc")
def test_a_killed_run_is_said_and_resumed(journey, tmp_path, text):
    path = tmp_path / "bench.toml"
    path.write_text(text.replace("duration_s  ", "duration_s = 400 #"), encoding="utf-8")
    page = journey()
    page.get_by_text("Ready to fly: 2,000 frames").wait_for()
    start(page, "killed.h5", "0:600")
    jobs = find(page, "jobs")
    find_recording(page, "killed.h5").get_by_text("running").wait_for(timeout=240_000)
    page.wait_for_function("/running [1-9]/.test(document.querySelector('[data-test=job-state]')?.textContent)")
    process = find_run(tmp_path)
    assert process is not None
    os.kill(process, signal.SIGKILL)
    jobs.get_by_text("the process was killed (SIGKILL)").wait_for()
    jobs.get_by_text("frames are kept, resume it").wait_for()
    find_recording(page, "killed.h5").get_by_text("interrupted").wait_for()
    find(page, "resume").click()
    jobs.get_by_text("done", exact=True).wait_for(timeout=240_000)
    find_recording(page, "killed.h5").get_by_text("complete").wait_for()
    run_command_line(path, tmp_path / "command.h5", "0:600")
    assert find_differences(tmp_path / "killed.h5", tmp_path / "command.h5") == []


def test_a_full_disk_is_said_and_loses_nothing(chromium, tmp_path, text):
    with mount_small_disk(tmp_path) as enlarge:
        path = tmp_path / "bench.toml"
        path.write_text(text.replace("duration_s  ", "duration_s = 400 #"), encoding="utf-8")
        before = path.read_bytes()
        with serve_studio(tmp_path) as served, watch_pages(chromium, served) as open_tab:
            page = open_tab()
            page.get_by_text("Ready to fly: 2,000 frames").wait_for()
            start(page, "large.h5", "0:400")
            jobs = find(page, "jobs")
            jobs.get_by_text("No space left on device").wait_for(timeout=240_000)
            fill(tmp_path)
            edit_on_a_full_disk(page)
            assert path.read_bytes() == before
            assert enlarge()
            find(page, "page-run").click()
            find(page, "resume").click()  # of the file, which is as it was
            jobs.get_by_text("done", exact=True).wait_for(timeout=240_000)
            run_command_line(path, tmp_path / "command.h5", "0:400")
            assert find_differences(tmp_path / "large.h5", tmp_path / "command.h5") == []
            find(page, "page-build").click()
            find(page, "save").click()
            page.get_by_text("saved bench.toml").wait_for()
            assert b"energy_mj = 40" in path.read_bytes()


def fill(folder):
    """Fill the rest of a small disk."""
    with (folder / "filler").open("wb", buffering=0) as file:
        try:
            while file.write(b"\0" * 1024):
                pass
        except OSError:
            return


def edit_on_a_full_disk(page):
    """Edit the scenario, and see that neither its draft nor its file can be written, and that the edit stays."""
    find(page, "page-build").click()
    find(page, "table-lidar.laser").click()
    energy = find_input(page, "lidar.laser.energy_mj")
    energy.fill("40")
    energy.press("Tab")
    page.get_by_text(".bench.toml.draft: ").wait_for()
    find(page, "save").click()
    page.get_by_text("not saved: ").wait_for()
    page.get_by_text("bench.toml (edited)").wait_for()
    assert energy.input_value() == "40"
