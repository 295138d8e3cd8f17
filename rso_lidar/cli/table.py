"""Tables on a terminal or in a pipe: the columns that fit, the most important ones first, and the names of the rest."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from rso_lidar.cli.console import make_console
from rso_lidar.cli.terminal import echo
from rso_lidar.files import align_columns

_GAP = 2  # spaces between columns
_LEAST_TEXT = 30  # columns of characters of a description, before other columns are left out
_PIPE_WIDTH = 80  # columns of characters where there is no terminal


@dataclass(frozen=True)
class PrintedTable:
    """A table with its title and notes.

    Parameters
    ----------
    title : above the table
    heads, rows : cells of text
    text_heads : heads of the columns that align to the left
    order : heads by importance; heads that it does not name come last
    naming : number of the first heads in `order` that are always shown
    notes : lines below the table
    empty : what stands in place of a table without rows
    """

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    text_heads: Collection[str]
    order: Sequence[str]
    naming: int
    notes: Sequence[str]
    empty: str

    def print(self) -> None:
        """Print the table in the width of the terminal, or in 80 columns to a file or pipe."""
        from rich.table import Table

        console = make_console()
        if not self.rows:
            for line in (self.title, self.empty, *self.notes):
                echo(line)
            return
        fit = self.choose_columns(console.width if console.is_terminal else _PIPE_WIDTH)
        hidden = [head for k, head in enumerate(self.heads) if k not in fit]
        if not console.is_terminal:
            cells = [[row[k] for k in fit] for row in (self.heads, *self.rows)]
            left = [place for place, k in enumerate(fit) if self.heads[k] in self.text_heads]
            lines = [self.title, *align_columns(cells, left)]
            lines += (
                [f"not in {_PIPE_WIDTH} columns: {'; '.join(hidden)}; write all with -o NAME.csv"] if hidden else []
            )
            for line in (*lines, *self.notes):
                echo(line)
            return
        shown = Table(box=None, header_style="bold", padding=(0, _GAP, 0, 0), pad_edge=False)
        for k in fit:
            is_text = self.heads[k] in self.text_heads
            shown.add_column(self.heads[k], justify="left" if is_text else "right", no_wrap=True, overflow="ellipsis")
        for row in self.rows:
            shown.add_row(*(row[k] for k in fit))
        console.print(self.title, style="bold")
        console.print(shown)
        if hidden:
            console.print(f"too wide for this terminal: {'; '.join(hidden)}; write all columns with -o NAME.csv")
        for line in self.notes:
            console.print(line)

    def choose_columns(self, width: int) -> list[int]:
        """Choose the columns that fit a width, the most important ones first.

        Parameters
        ----------
        width : columns of characters

        Returns
        -------
        list of int
            Indices of the chosen columns, in order; those that identify a row are always included.
        """
        needs = [max(map(len, column)) + _GAP for column in zip(self.heads, *self.rows, strict=True)]
        left = width + _GAP
        chosen = []
        rank = {head: place for place, head in enumerate(self.order)}
        for name in sorted(self.heads, key=lambda head: rank.get(head, len(rank))):
            k = self.heads.index(name)
            if name in self.order[: self.naming] or needs[k] <= left:
                chosen.append(k)
                left -= needs[k]
        return sorted(chosen)


def print_descriptions(
    heads: Sequence[str], rows: Sequence[Sequence[str]], order: Sequence[str], folded: Collection[str], more: str
) -> None:
    """Print a table with columns of descriptions, which are folded to the width of a terminal; a pipe gets all columns.

    Parameters
    ----------
    heads, rows : cells of text
    order : heads by importance; where the terminal is narrow, the last ones are left out
    folded : heads of descriptions
    more : how to see the columns that are left out
    """
    from rich.table import Table

    console = make_console()
    if not console.is_terminal:
        for line in align_columns([list(heads), *map(list, rows)], range(len(heads))):
            echo(line.rstrip())
        return
    needs = {head: max(len(row[k]) for row in (heads, *rows)) + _GAP for k, head in enumerate(heads)}
    needs |= {head: min(needs[head], _LEAST_TEXT + _GAP) for head in folded}
    chosen, left = set(order[:1]), console.width + _GAP - needs[order[0]]
    for head in order[1:]:
        if needs[head] <= left:
            chosen.add(head)
            left -= needs[head]
    shown = Table(box=None, header_style="bold", padding=(0, _GAP, 0, 0), pad_edge=False)
    for head in heads:
        if head in chosen:
            shown.add_column(head, no_wrap=head not in folded, ratio=1 if head in folded else None)
    for row in rows:
        shown.add_row(*(cell for head, cell in zip(heads, row, strict=True) if head in chosen))
    console.print(shown)
    if len(chosen) < len(heads):
        hidden = "; ".join(head for head in heads if head not in chosen)
        console.print(f"too wide for this terminal: {hidden}; {more}")
