"""Options of commands that write files; `draft.free` checks each output before work begins."""

from typing import Annotated

import typer

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]
