"""`rso-lidar models`: what can be flown past."""

from rich.console import Console
from rich.table import Table

from rso_lidar.scene.library import models as catalogue


def models() -> None:
    """List the models that ship with rso_lidar."""
    table = Table("name", "size, m", "facets", "parts", "what", box=None, header_style="bold")
    for name, entry in catalogue().items():
        size = " x ".join(f"{side:.4g}" for side in entry.size_m)
        table.add_row(name, size, f"{entry.facets:,}", str(len(entry.parts)), entry.what)
    console = Console()
    console.print(table)
    console.print('\nIn a scenario: model = "tdrs". A path with a suffix or a slash reads a mesh of your own.')
