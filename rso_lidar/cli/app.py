"""The application: all commands in the order in which a user needs them, each loaded when it is called."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

# What typer raises for a word it cannot read; it carries its own copy of click, and names this class nowhere else.
usage_error: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")

# The first sentence of each command's help. A command is the function of its name in the module of its name; a group is the
# `app` there. The list of commands is printed without loading any of them.
COMMANDS = {
    "new": "Write a scenario file to start from.",
    "check": "Check a scenario and print a summary.",
    "budget": "Compute photons, detection and precision against range.",
    "camera": "Simulate a camera's data sheet, or fit a camera to measurements.",
    "truth": "Write or draw the true motion without rendering frames.",
    "timeline": "Draw or tabulate one encounter, frame by frame.",
    "disperse": "Fly a mission many times with errors.",
    "trade": "Run a trade study of scenario fields against figures of merit.",
    "parameters": "List all parameters of a scenario and figures derived from them.",
    "requirements": "Verify requirements on a scenario, a study or a recording.",
    "catalog": "List the objects of a catalogue, or write a selection of them.",
    "encounters": "List the close approaches of one object to others, or of any two.",
    "events": "List the intervals in which conditions on two objects hold.",
    "conjunction": "Compute the probability of collision of a conjunction message.",
    "run": "Simulate a scenario and record its frames with truth and labels.",
    "serve": "Serve a simulation to flight software in another process.",
    "fmu": "Write the instrument of a scenario as an FMU for co-simulation.",
    "export": "Write a recording in another format.",
    "info": "Print what a recording holds.",
    "plot": "Draw frames of a recording, their trajectory or curves.",
    "track": "Track the target of a recording and compare with the truth.",
    "fit": "Fit own and relative orbit to a recording by least squares.",
    "animate": "Animate a recording as GIF or MP4.",
    "studio": "Build, see and fly scenarios in a browser.",
    "view": "Show a recording in a viewer, frame by frame.",
    "schema": "Print the JSON Schema of the scenario file.",
    "dataset": "Make, check, publish, export and score datasets for learning.",
    "models": "List the models that can be targets, show one, or add your own.",
}
GROUPS = ("camera", "dataset", "models")


class _Commands(TyperGroup):
    """The group of all commands; only the one that is called is loaded."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands: Any = dict.fromkeys(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command by name, or None if there is none of that name."""
        if cmd_name not in self.commands:
            return None
        return self.commands[cmd_name] or self._load(cmd_name)

    def _load(self, name: str) -> Any:
        self.commands[name] = _build_command(name)
        return self.commands[name]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Print the list of commands."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def load_command(name: str) -> Callable[..., None] | typer.Typer:
    """Return the function of a command, or the application of a group of commands."""
    module = importlib.import_module(f"rso_lidar.cli.{name}")
    command: Callable[..., None] | typer.Typer = module.app if name in GROUPS else getattr(module, name)
    return command


def _build_command(name: str) -> Any:
    """Build a command as typer's own copy of click represents it."""
    typer_app = load_command(name)
    if not isinstance(typer_app, typer.Typer):
        typer_app, function = typer.Typer(rich_markup_mode=None, add_completion=False), typer_app
        typer_app.command(name)(function)
    click_command = typer.main.get_command(typer_app)
    click_command.name = name
    return click_command


app = typer.Typer(
    name="rso-lidar",
    cls=_Commands,
    help="Fly a flash LiDAR past a satellite before you build one.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"max_content_width": 110},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"rso-lidar {importlib.metadata.version('rso-lidar')}")  # noqa: TID251 - names nothing
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Fly a flash LiDAR past a satellite before you build one."""
