"""`rso-lidar dataset score`: score predictions on a split of a dataset, and compare them with older ones."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import Dark, Overwrite, choose_scheme
from rso_lidar.cli.terminal import echo
from rso_lidar.dataset import (
    Comparison,
    Dataset,
    Scorecard,
    check_score_report,
    compare,
    format_comparison,
    format_scores,
    save_score_report,
)
from rso_lidar.dataset import score as score_files
from rso_lidar.errors import DatasetError


def score(
    predictions: Annotated[
        list[str],
        typer.Argument(
            metavar="PREDICTIONS", help="Predictions (.csv, .parquet, .npz, .h5), one file for each training run."
        ),
    ],
    dataset: Annotated[Path, typer.Option("--dataset", metavar="FOLDER", help="Folder of the dataset.")],
    split: Annotated[str, typer.Option("--split", help="Split to score.")] = "test",
    contest: Annotated[
        bool,
        typer.Option(
            "--contest",
            help="Predictions number frames as `publish --hidden-labels` does; FOLDER has the labels and the key.",
        ),
    ] = False,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o", "--output", help="Report (.html), all numbers (.json), or a folder of pictures; may be repeated."
        ),
    ] = None,
    against: Annotated[
        list[str] | None,
        typer.Option(
            "--against", metavar="OLD", help="Older predictions to compare with; may be repeated, one for each run."
        ),
    ] = None,
    margin: Annotated[
        list[str] | None,
        typer.Option(
            "--margin",
            metavar="NAME=VALUE",
            help="Loss of a figure of merit that does not count, such as accuracy=0.01.",
        ),
    ] = None,
    level: Annotated[
        float, typer.Option("--level", metavar="P", help="Probability of any wrong 'worse' in a comparison.")
    ] = Comparison.LEVEL,
    confidence: Annotated[
        float, typer.Option("--confidence", metavar="P", help="Confidence level of the intervals.")
    ] = Scorecard.confidence,
    min_lit_pixels: Annotated[
        int,
        typer.Option(
            "--min-lit-pixels",
            min=0,
            help="Least number of lit pixels of a frame with a target; frames with fewer are left out.",
        ),
    ] = 1,
    replicates: Annotated[
        int, typer.Option("--replicates", min=100, max=100_000, help="Draws of the bootstrap over encounters.")
    ] = Scorecard.replicates,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Score predictions on a split of a dataset, and compare them with older ones.

    With --against, the exit status is 1 if a figure of merit is significantly worse, and 0 otherwise.
    """
    for option, value in (("--level", level), ("--confidence", 1.0 - confidence)):
        if not 0.0 < value < 0.5:
            allowed = "above 0 and below 0.5" if option == "--level" else "above 0.5 and below 1"
            raise DatasetError(f"{option}: is not a probability {allowed}; give 0.05 and 0.95, for example")
    margins = dict(_parse_margin(text) for text in margin or ())
    if margins and not against:
        raise DatasetError("--margin: compares with nothing; give --against OLD, or leave it out")
    places = [check_score_report(place, overwrite=overwrite) for place in output or ()]
    scheme = choose_scheme(dark, places)
    opened = Dataset(dataset)
    options = {"contest": contest, "min_lit_pixels": min_lit_pixels, "replicates": replicates, "confidence": confidence}
    card = score_files(predictions, opened, split, **options)  # type: ignore[arg-type]
    comparison = None
    if against:
        comparison = compare(card, score_files(against, opened, split, **options), margins, level)  # type: ignore[arg-type]
    for line in format_scores(card):
        echo(line)
    if comparison is not None:
        echo()
        for line in format_comparison(comparison):
            echo(line)
    for place in places:
        for path in save_score_report(card, place, comparison, scheme, overwrite=overwrite):
            echo(path)
    if comparison is not None and comparison.is_worse:
        raise typer.Exit(1)


def _parse_margin(text: str) -> tuple[str, float]:
    """Parse ``NAME=VALUE``."""
    name, sign, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if not sign or not name.strip() or not 0.0 <= value < float("inf"):
        raise DatasetError(f"--margin {text}: is not NAME=VALUE with a number from 0; write for example accuracy=0.01")
    return name.strip(), value
