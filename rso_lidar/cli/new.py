"""`rso-lidar new`: a scenario to start from, copied from a shipped example."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import Overwrite
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.files import check_suffix, check_writable, write_atomically
from rso_lidar.scenario import Example, find_examples

_DEFAULT = "tdrs_approach"


def new(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="File to write, .toml added; left out, the examples are listed."),
    ] = None,
    example: Annotated[
        str,
        typer.Option(
            "--from", metavar="EXAMPLE", help="Example to copy.", autocompletion=lambda: list(find_examples())
        ),
    ] = _DEFAULT,
    overwrite: Overwrite = False,
) -> None:
    """Write a scenario file to start from. It has comments, and the files that it needs are written beside it."""
    known = find_examples()
    if example not in known:
        guess = did_you_mean(example, known) or ";"
        raise ScenarioError(f"--from {example}: no example of that name{guess} (known: {', '.join(known)})")
    if name is None:
        for line in _list_examples(known):
            echo(line)
        return
    source = known[example]
    place = check_writable(_check_place(name), (".toml",), overwrite=overwrite)
    written = {place: _replace_head(source, place).encode()}
    for companion in source.companions:
        target = place.parent / companion.name
        if not target.is_file() or target.read_bytes() != companion.read_bytes():  # the same file may stay
            written[check_writable(target, overwrite=overwrite)] = companion.read_bytes()
    for target, content in reversed(written.items()):  # the scenario last: it is there only with what it needs
        with write_atomically(target) as draft:
            draft.write_bytes(content)
    for target in written:
        echo(f"{target}")
    echo(f"from: {source.path}; its twin {source.name}.py, there too, is the same in Python")
    file, recording = shlex.quote(str(place)), shlex.quote(str(place.with_suffix(".h5")))
    echo(f"next: edit it; rso-lidar check {file}; rso-lidar run {file} -o {recording}")


def _check_place(name: str) -> Path:
    """Return the file that a name means; the suffix is optional."""
    place = Path(name)
    if not name.isprintable() or not place.name.strip(". "):
        raise ScenarioError(f"{name!r}: is not a file name; give one such as approach")
    if not place.suffix:
        place = place.with_name(f"{place.name}.toml")
    check_suffix(place, (".toml",))
    return place  # `free` expands a leading ~


def _list_examples(known: dict[str, Example]) -> Iterator[str]:
    """Yield a line per example: its name, and the first sentence of the comment at the top of the file."""
    width = max(map(len, known))
    for name, example in known.items():
        yield f"{name:<{width}}  {example.summary}"
    yield f"\nwrite one to edit: rso-lidar new NAME --from EXAMPLE ({_DEFAULT} if left out)"


def _replace_head(example: Example, place: Path) -> str:
    """Return the text of an example with instructions at the top, and the name of the new file as its title."""
    file, recording = shlex.quote(place.name), shlex.quote(f"{place.stem}.h5")
    hints = {
        f"rso-lidar check {file}": "orbit, geometry, link budget, warnings",
        f"rso-lidar run {file} -o {recording}": "fly it; --frames 0:10 for a first look",
        "rso-lidar schema": "every key with its meaning, for editors that complete TOML",
        "rso-lidar models": "what can be flown past; a path flies a mesh of your own",
    }
    width = max(map(len, hints))
    head = [f"# Made by `rso-lidar new --from {example.name}`. A key that is left out takes its default."]
    head += [f"#   {command:<{width}}   {what}" for command, what in hints.items()]
    return "\n".join([*head, "#", example.rename(place.stem)])
