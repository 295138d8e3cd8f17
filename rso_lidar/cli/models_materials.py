"""`rso-lidar models materials`: the shipped materials."""

from rich.table import Table

from rso_lidar.cli.console import make_console
from rso_lidar.cli.models_show import WIDE
from rso_lidar.mission_analysis import list_materials


def print_materials() -> None:
    """List the shipped materials: reflectance at both wavelengths, its quality, and a description."""
    lines, table = list_materials(), Table(box=None, header_style="bold")
    for title in ("name", "BRDF", *(f"{nm:g} nm" for nm in lines[0].reflectance)):
        table.add_column(title, no_wrap=True)
    console = make_console(WIDE)
    fold = console.is_terminal
    table.add_column("what", no_wrap=not fold, ratio=3 if fold else None)
    table.add_column("confidence", no_wrap=not fold, ratio=2 if fold else None)
    for line in lines:
        shares = (f"{share:.3g}" for share in line.reflectance.values())
        table.add_row(line.name, line.kind, *shares, line.what, line.confidence)
    console.print(table)
    console.print(
        '\nReflectance is of all directions together. In a scenario: material = "mli_gold", or\n'
        'part_materials = { bus = "mli_gold_crinkled" }; docs/scenario.md tells how to give one of your own.',
    )
