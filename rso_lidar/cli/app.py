"""The application: all commands, in sections by what they are for, each loaded when it is called."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from rso_lidar.user_settings import read_settings

# What typer raises for a word it cannot read; it carries its own copy of click, and names this class nowhere else.
usage_error: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")

# The first sentence of each command's help, under what it is for. A command is the function of its name in the module of its
# name; a group is the `app` there. The list of commands is printed without loading any of them.
SECTIONS = {
    "Start": {
        "new": "Write a scenario file to start from.",
        "check": "Check a scenario and print a summary.",
        "run": "Simulate a scenario; record its frames with truth and labels.",
        "plot": "Draw frames of a recording, their trajectory or curves.",
        "config": "Show and set your own settings, and whose code you trust.",
    },
    "Plan a mission": {
        "budget": "Compute photons, detection and precision against range.",
        "camera": "Print a camera's data sheet, or fit a camera to measurements.",
        "parameters": "List all parameters of a scenario, and figures derived.",
        "truth": "Write or draw the true motion without rendering frames.",
        "timeline": "Draw or tabulate one encounter, frame by frame.",
        "catalog": "List the objects of a catalogue, or write a selection of them.",
        "encounters": "List close approaches of one object to others, or of any two.",
        "events": "List the intervals in which conditions on two objects hold.",
        "conjunction": "Compute the probability of collision of a conjunction message.",
        "targeter": "Find fields at which a flight meets goals and limits.",
        "disperse": "Fly a mission many times with errors.",
        "trade": "Run a trade study of scenario fields against figures of merit.",
        "requirements": "Verify requirements on a scenario, a study or a recording.",
    },
    "Look at a recording": {
        "info": "Print what a recording holds.",
        "view": "Show a recording in a viewer, frame by frame.",
        "animate": "Animate a recording as GIF or MP4.",
        "export": "Write a recording in another format.",
        "track": "Track the target of a recording and compare with the truth.",
        "fit": "Fit own and relative orbit to a recording by least squares.",
    },
    "Learn": {
        "dataset": "Make, check, publish, export and score datasets for learning.",
        "models": "List the models of targets, show one, or add your own.",
    },
    "Connect": {
        "studio": "Build, see and fly scenarios in a browser.",
        "serve": "Serve a simulation to flight software in another process.",
        "fmu": "Write the instrument of a scenario as an FMU.",
        "schema": "Print the JSON Schema of the scenario file.",
    },
}
COMMANDS = {name: sentence for section in SECTIONS.values() for name, sentence in section.items()}
GROUPS = ("camera", "config", "dataset", "models")


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
        """Print the list of commands, section by section, in columns that line up."""
        width = max(map(len, COMMANDS))
        for title, section in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(f"{name:{width}}", sentence) for name, sentence in section.items()])


class _OneOutput(TyperCommand):
    """A command that refuses a second output where it writes one, since click drops the first without a word."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a call."""
        _, _, given = self.make_parser(ctx).parse_args(args=list(args))
        if not ctx.resilient_parsing:
            for option in self.params:
                if "--output" in option.opts and not option.multiple and given.count(option) > 1:
                    from rso_lidar.errors import ScenarioError

                    raise ScenarioError("-o: is given twice, and this command takes one; give it once")
        return super().parse_args(ctx, args)


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
    for registered in typer_app.registered_commands:
        registered.cls = _OneOutput
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
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Fly a flash LiDAR past a satellite before you build one."""
    if context.invoked_subcommand != "config":
        read_settings()  # a file that cannot be read is an error before any work
