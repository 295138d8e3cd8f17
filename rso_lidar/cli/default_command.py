"""Groups of commands with a default: `models NAME` is `models show NAME`, `camera FILE` is `camera datasheet FILE`."""

from typing import Any

from typer.core import TyperGroup


class WholeSentences(TyperGroup):
    """A group whose help prints the first sentence of each command whole, where click cuts it to one line."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Print the list of commands."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.get_short_help_str(1000)) for name, command in self.commands.items()])


def default_to(default: str) -> type[TyperGroup]:
    """Make the class of a group in which a first word that is no command is the first argument of the default command.

    Parameters
    ----------
    default : name of the command
    """

    class WithDefault(WholeSentences):
        """A group of commands with a default."""

        def resolve_command(self, ctx: Any, args: list[str]) -> Any:
            """Return the command of the first word, or the default command with all words."""
            known = args[0].startswith("-") or self.get_command(ctx, args[0]) is not None
            return super().resolve_command(ctx, args if known else [default, *args])

        def shell_complete(self, ctx: Any, incomplete: str) -> Any:
            """Return the completions of the next word: commands, and first arguments of the default command."""
            (name,) = self.commands[default].params[:1]
            return [*super().shell_complete(ctx, incomplete), *name.shell_complete(ctx, incomplete)]

    return WithDefault
