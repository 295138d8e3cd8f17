"""The page of the command line, made from the commands themselves: usage, arguments and options."""

from pathlib import Path
from typing import Any

import typer

from rso_lidar.cli.app import SECTIONS, app


def option_rows(command: Any, context: Any) -> list[str]:
    """Return a Markdown table of the arguments and options of a command."""
    rows = ["| argument or option | meaning |", "| --- | --- |"]
    for parameter in command.params:
        if record := parameter.get_help_record(context):
            name, meaning = (" ".join(text.split()).replace("|", "\\|") for text in record)
            rows.append(f"| `{name}` | {meaning} |")
    return rows


def command_section(name: str, command: Any, level: int) -> list[str]:
    """Return the section of a command, and those of its own commands below it."""
    if command.hidden:
        return []
    context = command.context_class(command, info_name=f"rso-lidar {name}")
    lines = [f"{'#' * level} {name}", "", *(command.help or "").replace("\b", "").splitlines(), ""]
    lines += [
        "```text",
        command.get_usage(context).removeprefix("Usage: "),
        "```",
        "",
        *option_rows(command, context),
        "",
    ]
    for inner, child in getattr(command, "commands", {}).items():
        lines += command_section(f"{name} {inner}", child, level + 1)
    return lines


def commands_page() -> str:
    """Return the page of all commands."""
    root = typer.main.get_command(app)
    context = root.context_class(root, info_name="rso-lidar")
    lines = [
        "# Commands",
        "",
        "What `rso-lidar COMMAND --help` says, on one page. [Rules](../command_line.md) hold for all commands.",
        "",
    ]
    for title, names in SECTIONS.items():
        lines += [f"## {title}", ""]
        for name in names:
            lines += command_section(name, root.get_command(context, name), 3)
    return "\n".join(lines)


def write_page(app):
    """Write the page where Sphinx finds it."""
    file = Path(app.srcdir) / "api" / "commands.md"
    file.parent.mkdir(exist_ok=True)
    text = commands_page()
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def setup(app):
    """Connect the writer to Sphinx."""
    app.connect("builder-inited", write_page, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
