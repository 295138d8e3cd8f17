"""The guide of a first visit: from the example to a first recording, one step on each page of the studio."""

from __future__ import annotations

from nicegui import ui

from rso_lidar.scenario import find_examples
from rso_lidar.studio.pages.elements import draw_button, mark, tell_errors
from rso_lidar.studio.state import BrowserTab

_EXAMPLE = "tdrs_approach"


STEPS = (  # title and text, the page, and the mark of the element that it points at
    ("Welcome", "build", "",
     "A flash lidar flies past a relay satellite: you look at the scenario, see one frame of it, and record some. "
     "“Next” takes the TDRS example into your folder."),
    ("The scenario", "build", "tables",
     "Left are its tables, in the middle the fields of one table with unit and meaning, right the text of the file. Form "
     "and text are the same document. Below the text, the check says whether it can be flown."),
    ("One frame", "see", "time",
     "This is the last frame, 300 m from the satellite; the slider goes back to 3 km. Click a bright pixel to see its "
     "photons and its waveform. The first frame after an installation takes some 20 s."),
    ("A recording", "run", "start",
     "Press “Start”: the frames appear while they are written. “Frames” is set to every fourth of the last 100; "
     "leave it empty to make all 540."),
    ("That is all", "run", "recordings",
     "Change a field and record again under another name, then compare the two. “Guide” in the header comes back here."),
)  # fmt: skip


class Guide:
    """A card in a corner of the page away from what it speaks about, which can be closed at any time."""

    def __init__(self, tab: BrowserTab) -> None:
        self._tab, self._at, self._client = tab, 0, ui.context.client
        self._card = mark(ui.card().classes("studio-guide"), "guide", 'role="region" aria-label="Guide"')
        self._card.set_visibility(False)

    def start(self) -> None:
        """Show the first step."""
        self._draw(0)

    def _draw(self, number: int) -> None:
        self._at, last = number, number == len(STEPS) - 1
        title, page, point, text = STEPS[number]
        self._tab.page_chosen.emit(page)
        if page == "see":
            self._tab.end_chosen.emit()
        elif point == "start":
            self._tab.frames_proposed.emit("440:540:4")
        self._card.clear()
        self._card.props["data-page"] = page
        with self._card:
            ui.label(f"{title} ({number + 1} of {len(STEPS)})").classes("font-medium")
            ui.label(text).props('aria-live="polite"')
            with ui.row().classes("w-full justify-end"):
                draw_button("Close", self._close, "guide-close", "flat")
                next_step = self._close if last else self._go_on
                draw_button("Done" if last else "Next", next_step, "guide-next", "unelevated")
        self._card.set_visibility(True)
        self._point_at(point)

    def _point_at(self, name: str) -> None:
        """Outline the element with a mark, and no other."""
        self._client.run_javascript(
            "for (const one of document.querySelectorAll('[data-pointed]')) one.removeAttribute('data-pointed');"
            f"document.querySelector('[data-test=\"{name or 'none'}\"]')?.setAttribute('data-pointed', '')"
        )

    def _close(self) -> None:
        self._card.set_visibility(False)
        self._point_at("")

    def _go_on(self) -> None:
        with tell_errors():
            if self._at == 0:
                self._take_example()
            self._draw(self._at + 1)

    def _take_example(self) -> None:
        """Save the example in the folder, or open it where it is there already."""
        name, workspace = f"{_EXAMPLE}.toml", self._tab.workspace
        if name in workspace.folder.list_files((".toml",)):
            document = workspace.open_document(name)
        else:
            document = workspace.new_document(find_examples()[_EXAMPLE].text)
            workspace.save_as(document, name)
        self._tab.show(document)
