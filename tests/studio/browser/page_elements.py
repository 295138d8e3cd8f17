"""Elements of the pages as journeys find, read and compare them, and the command line beside them."""

import io
import re

import numpy as np
import pytest
from PIL import Image

import rso_lidar as rl
from rso_lidar.cli import main

IS_DRAWN = "(place) => { const it = document.querySelector(place); return it && it.complete && it.naturalWidth > 99; }"


def find(page, name):
    """Return the element with a `data-test`."""
    return page.locator(f'[data-test="{name}"]').first


def find_input(page, place):
    """Return the input of the field at a place; NiceGUI puts the mark on it, or on the element around it."""
    mark = f'[data-test="field-{place}"]'
    return page.locator(f"input{mark}, {mark} input").first


def find_thumb(page, name):
    """Return the part of a slider that takes the focus."""
    return page.locator(f'[data-test="{name}"] [tabindex]').first


def find_recording(page, name):
    """Return the row of a recording in the table."""
    row = page.locator('[data-test="recordings"] tbody tr')
    return row.filter(has_text=re.compile(rf"(?<!\w){re.escape(name)}"))


def wait_until_drawn(page, name, timeout_ms=180_000):
    """Wait until an image is drawn. A new installation compiles the kernels first."""
    page.wait_for_function(IS_DRAWN, arg=f'[data-test="{name}"] img', timeout=timeout_ms)


def see_variance(element):
    """Return how much the pixels of an element differ, as the page shows it."""
    return float(np.asarray(Image.open(io.BytesIO(element.screenshot())).convert("L"), dtype=float).var())


def start_run(page, name, frames):
    """Start a run with the form of the page Run, and wait until it is done."""
    page.get_by_label("Frames").fill(frames)
    page.get_by_label("Name of the result").fill(name)
    page.keyboard.press("Tab")
    find(page, "start").click()
    jobs = find(page, "jobs")
    jobs.get_by_text(f"Run: {name}").wait_for()
    jobs.locator(".q-card").filter(has_text=name).get_by_text("done", exact=True).wait_for(timeout=240_000)
    find_recording(page, name).get_by_text("complete").wait_for()


def run_command_line(source, output, frames):
    """Record frames of a scenario by the command line, in this process."""
    with pytest.raises(SystemExit) as left:
        main(["run", str(source), "-o", str(output), "--frames", frames])
    assert not left.value.code


def find_differences(first, second):
    """Return the names of the arrays of two recordings that differ in a byte, or that only one of them has."""
    arrays = []
    for path in (first, second):
        with rl.open(path) as recording:
            arrays.append({name: recording.dataset(name)[:].tobytes() for name in recording.paths})
    names = arrays[0].keys() | arrays[1].keys()
    return sorted(name for name in names if arrays[0].get(name) != arrays[1].get(name))
