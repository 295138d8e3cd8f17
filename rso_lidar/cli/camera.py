"""`rso-lidar camera`: a camera of your own, calibrated by measurements."""

import typer

from rso_lidar.cli import camera_fit

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, no_args_is_help=True)


@app.callback()
def camera() -> None:
    """Calibrate a camera of your own by measurements."""


app.command("fit")(camera_fit.fit)
