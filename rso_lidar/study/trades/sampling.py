"""The points of a trade study: combinations of values of its axes."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from rso_lidar.study.trades.definition import Grid, Random, Study


def list_points(study: Study) -> list[tuple[Any, ...]]:
    """List the points of a study, each with one value per axis; random points depend on the study's seed alone."""
    if isinstance(study.sampling, Grid):
        return list(itertools.product(*(axis.grid() for axis in study.axis)))
    share = draw_shares(study)
    return list(zip(*(axis.at(column) for axis, column in zip(study.axis, share.T, strict=True)), strict=True))


def draw_shares(study: Study) -> np.ndarray:
    """Draw the relative positions (point, axis) of random points along each axis, from 0 to below 1."""
    assert not isinstance(study.sampling, Grid)
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(study.seed)))
    n, dimensions = study.sampling.points, len(study.axis)
    if isinstance(study.sampling, Random):
        return rng.random((n, dimensions))
    from scipy.stats import qmc

    drawn: np.ndarray = qmc.LatinHypercube(dimensions, rng=rng).random(n)
    return drawn


def list_settings(study: Study, point: tuple[Any, ...]) -> dict[str, str]:
    """List the TOML text of each field at a point."""
    return {
        field: text
        for axis, value in zip(study.axis, point, strict=True)
        for field, text in axis.settings(value).items()
    }
