"""The guide of a first visit: from the example to a first recording, one step on each page of the studio."""

from __future__ import annotations

from dataclasses import dataclass

from nicegui import ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.scenario.examples import find_examples
from rso_lidar.studio.state import BrowserTab

_EXAMPLE = "tdrs_approach"


@dataclass(frozen=True)
class GuideStep:
    """One step: what it says, on which page, and which element it points at by its `data-test`."""

    title: str
    text: str
    page: str
    points_at: str = ""


STEPS = (
    GuideStep(
        "Welcome",
        "A flash lidar flies past a relay satellite: you look at the scenario, see one frame of it, and record some. "
        "“Next” takes the TDRS example into your folder.",
        "build",
    ),
    GuideStep(
        "The scenario",
        "Left are its tables, in the middle the fields of one table with unit and meaning, right the text of the file. Form "
        "and text are the same document. Below the text, the check says whether it can be flown.",
        "build",
        "tables",
    ),
    GuideStep(
        "One frame",
        "Move the slider: the satellite grows from 1.8 km to 300 m. Click a bright pixel to see its photons and its "
        "waveform. The first frame after an installation takes some 20 s.",
        "see",
        "time",
    ),
    GuideStep("A recording", "Press “Start”: the frames appear while they are written.", "run", "start"),
    GuideStep(
        "That is all",
        "Change a field and record again under another name, then compare the two. “Guide” in the header comes back here.",
        "run",
        "recordings",
    ),
)


class Guide:
    """A card beside the page, which never covers what it speaks about and can be closed at any time."""

    def __init__(self, tab: BrowserTab) -> None:
        self._tab, self._at, self._client = tab, 0, ui.context.client
        self._card = (
            ui.card().classes("studio-guide").props('role="region" aria-label="Guide" data-test="guide"').mark("guide")
        )
        self._card.set_visibility(False)

    def start(self) -> None:
        """Show the first step."""
        self._at = 0
        self._draw()

    def _draw(self) -> None:
        step = STEPS[self._at]
        self._tab.page_chosen.emit(step.page)
        self._card.clear()
        with self._card:
            ui.label(f"{step.title} ({self._at + 1} of {len(STEPS)})").classes("font-medium")
            ui.label(step.text).props('aria-live="polite"')
            with ui.row().classes("w-full justify-end"):
                ui.button("Close", on_click=self._close).props('flat dense data-test="guide-close"').mark("guide-close")
                last = self._at == len(STEPS) - 1
                ui.button("Done" if last else "Next", on_click=self._close if last else self._go_on).props(
                    'dense unelevated data-test="guide-next"'
                ).mark("guide-next")
        self._card.set_visibility(True)
        point = step.points_at or "none"
        self._client.run_javascript(
            "document.querySelectorAll('.studio-pointed').forEach(e => e.classList.remove('studio-pointed'));"
            f"document.querySelector('[data-test=\"{point}\"]')?.classList.add('studio-pointed')"
        )

    def _close(self) -> None:
        self._card.set_visibility(False)
        self._client.run_javascript(
            "document.querySelectorAll('.studio-pointed').forEach(e => e.classList.remove('studio-pointed'))"
        )

    def _go_on(self) -> None:
        if self._at == 0 and not self._take_example():
            return
        self._at += 1
        self._draw()

    def _take_example(self) -> bool:
        """Save the example in the folder, or open it where it is there already; return whether it is shown now."""
        name = f"{_EXAMPLE}.toml"
        workspace = self._tab.workspace
        try:
            if name in workspace.folder.list_files((".toml",)):
                document = workspace.open_document(name)
            else:
                document = workspace.new_document(find_examples()[_EXAMPLE].read_text(encoding="utf-8"))
                workspace.save_as(document, name)
        except (RsoLidarError, OSError) as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return False
        self._tab.show(document)
        return True
