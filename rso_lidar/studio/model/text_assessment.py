"""Assessment of a text: the scenario that it is, or what is wrong with it and where."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from rso_lidar.errors import RsoLidarError, ScenarioError, collect_warnings, suppress_warnings
from rso_lidar.files import explain_unreadable
from rso_lidar.part import parse_toml
from rso_lidar.scenario import Scenario, iterate_named_files, iterate_texts, list_named_code
from rso_lidar.scene import model
from rso_lidar.shipped import find, is_shipped
from rso_lidar.studio.model.problem_place import locate_problem
from rso_lidar.studio.model.root_folder import Folder
from rso_lidar.units import format_count

_CODE = re.compile(r"\bdynamics\b|\bfmu\b", re.IGNORECASE)  # fields and files that hold Python or native code

_BLANK = "No scenario yet. “New” on the page Build begins with an example."
_STUDY = "a trade study or a dataset, not a scenario; choose it as the job on page Run, and start it"
_CODE_REFUSED = "the studio runs none of a file; fly it with `rso-lidar run` on the command line"


@dataclass(frozen=True)
class Assessment:
    """A text with the scenario that it is; or with its first problem, the place of that as a TOML key, and its line.

    `refusal` is the reason why the studio does not fly a valid scenario, in one line; empty where it may be flown.
    """

    text: str
    scenario: Scenario | None
    problem: str = ""
    place: str = ""
    line: int | None = None
    refusal: str = ""

    @property
    def is_blank(self) -> bool:
        """Whether nothing has been written yet, which is no error."""
        return not self.text.strip()

    @property
    def is_ready(self) -> bool:
        """Whether the text is a scenario that may be flown."""
        return self.scenario is not None and not self.refusal

    def tell(self, warnings: list[str] | None) -> str:
        """Return the verdict in one line, with the number of its warnings; None while they are not known."""
        if self.scenario is None or self.refusal:
            return self.problem or self.refusal
        count = "looking for warnings" if warnings is None else format_count(len(warnings), "warning")
        return f"Ready to fly: {format_count(self.scenario.time.n_frames, 'frame')}, {count}"


def assess(text: str, folder: Folder, title: str) -> Assessment:
    """Assess a text; the files that it names must lie inside the folder, or be shipped."""
    if not text.strip():
        return Assessment(text, None, _BLANK)
    refusal = ""
    try:
        with suppress_warnings():
            tables = parse_toml(text, title, ScenarioError)
            if isinstance(tables.get("scenario"), str):
                return Assessment(text, None, refusal=f"{title}: {_STUDY}")
            # Before any part sees the text: some read the files that they name.
            for place, name in iterate_named_files(tables):
                check_file(name, folder, f"{title}: {place}")
            scenario = Scenario.loads(text, folder=folder.path, where=title)
            _check_models(scenario, title)
            if named := list_named_code(scenario):
                refusal = f"names code, {named[0]}: {_CODE_REFUSED}"
            else:
                _ = scenario.bodies, scenario.pan_tilt, scenario.instrument  # these read the files that the text names
    except RsoLidarError as error:
        message = str(error)
        place, line = locate_problem(message.removeprefix(f"{title}: "), text)
        return Assessment(text, None, message, place, line)
    return Assessment(text, scenario, refusal=refusal)


def check_study(path: Path, folder: Folder) -> None:
    """Check that a trade study or dataset specification runs no code and names no file outside the folder.

    Each text in it is judged as if it named a file, because a setting can put it into any field of the scenario.

    Raises
    ------
    ScenarioError
        If it names code or a file outside, or its scenario cannot be flown here.
    """
    title = path.relative_to(folder.path).as_posix()
    tables = parse_toml(_read(path), title, ScenarioError)
    for text in iterate_texts(tables):
        for word in (text, *_list_values(text.partition("=")[2])):
            if _CODE.search(text):
                raise ScenarioError(f"{title}: '{text:.80}' names code: run it with `rso-lidar` on the command line")
            has_name = word and all(len(part.encode()) < 256 for part in word.split("/"))
            if word.startswith("~") or (has_name and not folder.has_inside(path.parent / word)):
                raise ScenarioError(
                    f"{title}: '{word:.80}' is outside the folder {folder.path.name}; copy the file into it"
                )
    named = tables.get("scenario")
    if not isinstance(named, str):
        return  # the command says that it is missing
    place = path.parent / named
    if place.is_file():
        load_flyable(place, folder, named)


def load_flyable(path: Path, folder: Folder, title: str) -> Scenario:
    """Load the scenario of a file as it is now, and check that it may be flown here.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is no scenario, or may not be flown.
    """
    assessment = assess(_read(path), folder, title)
    if assessment.scenario is None or assessment.refusal:
        raise ScenarioError(assessment.problem or f"{title}: {assessment.refusal}")
    return assessment.scenario


def _list_values(text: str) -> list[str]:
    """Return the texts in the value of a setting, as TOML or as it stands."""
    try:
        return [text, *iterate_texts(parse_toml(f"value = {text}", "value", ScenarioError))]
    except ScenarioError:
        return [text]


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ScenarioError(explain_unreadable(path.name, error)) from None
    except UnicodeError:
        raise ScenarioError(f"{path.name}: is not UTF-8 text; save it as UTF-8") from None


def describe(scenario: Scenario) -> str:
    """Return the description of a scenario with its warnings, as `rso-lidar check` prints it; it takes seconds."""
    try:
        return scenario.describe()
    except RsoLidarError as error:
        return str(error)


def list_warnings(assessment: Assessment, folder: Folder, title: str) -> list[str]:
    """List the warnings that `rso-lidar check` prints of a text that may be flown, by `Scenario.advice`.

    It takes seconds. The scenario is read again, because some warnings are given where files are read.
    """
    with collect_warnings() as lines:
        try:
            lines += Scenario.loads(assessment.text, folder=folder.path, where=title).advice()
        except RsoLidarError as error:
            lines.append(str(error))
    return list(dict.fromkeys(lines))


def check_file(name: str, folder: Folder, where: str) -> Path:
    """Check that a file that a text names is inside the folder or shipped, without opening it, and return its path.

    Raises
    ------
    ScenarioError
        If it lies outside, or is missing.
    """
    path = find(name, folder.path)
    try:
        if path is None or not is_shipped(path):
            folder.require_inside(path or folder.path / name)
    except (ScenarioError, OSError, ValueError):
        raise ScenarioError(f"{where}: '{name:.80}' is outside the folder {folder.path.name}; upload it here") from None
    if path is None or not path.is_file():
        raise ScenarioError(f"{where}: no file '{name:.80}' in the folder nor among the shipped data; upload it here")
    return path


def _check_models(scenario: Scenario, title: str) -> None:
    """Check that the catalogue has the models of the targets; their meshes are read when they are seen or flown."""
    for number, target in enumerate(scenario.target):
        try:
            if not target.is_path and target.library is None:
                model(target.shape)
        except RsoLidarError as error:
            raise ScenarioError(f"{title}: target[{number}].model: {error}") from None
