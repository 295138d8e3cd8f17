"""Make a map of heights and a map of hazards from the frames of a descent, and compare both with the true ground.

`python examples/studies/lunar_descent.py [picture.png]` flies examples/lunar_descent.toml, prints the tables of
lunar_descent.md and draws its picture.
"""

import sys
from pathlib import Path

import numpy as np

import rso_lidar as rl
from rso_lidar.picture import colour_maps, figures, palette, save_figure
from rso_lidar.study import (
    HAZARD,
    SAFE,
    UNKNOWN,
    ElevationMap,
    build_elevation_map,
    build_true_elevation,
    compare_maps,
    find_hazards,
)

SIZE_M, CELL_M = 200.0, 1.0
LIMITS = {"footprint_m": 5.0, "slope_deg": 10.0, "roughness_m": 0.3}
SEED = 1
STEP_M, TILT_DEG = 0.05, 0.02  # of a navigation that drifts: a random walk from flash to flash, and noise in attitude


def drifting(n_frames: int):
    """Return what gives the pose that a spacecraft believes in: right in the last frame, and the worse the earlier."""
    rng = np.random.default_rng(SEED)
    walk = np.cumsum(STEP_M * rng.standard_normal((n_frames, 3)), axis=0)
    tilt = TILT_DEG * rl.units.DEG * rng.standard_normal((n_frames, 3))

    def navigated(frame, pose):
        (place, turn), (a, b, c) = pose, tilt[frame.index]
        small = np.array([[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]])  # a turn by some 1e-4 rad, to second order
        return place + walk[frame.index] - walk[-1], small @ turn

    return navigated


def hazards(ground: ElevationMap) -> np.ndarray:
    """Return where a lander of the limits would meet a hazard."""
    return find_hazards(ground.fill_holes(), **LIMITS)


def table(found: ElevationMap, truth: ElevationMap) -> list[str]:
    """Return how heights and hazards agree, in lines."""
    lines = ["  slope          cells  coverage     bias      RMS   95 % within"]
    lines += [
        f"  {row.from_deg:2g} to {row.to_deg:2g}°{row.cells:10,d}{row.coverage:9.1%}{row.bias_m * 100:8.1f} cm"
        f"{row.rms_m * 100:6.1f} cm{row.worst_m * 100:8.1f} cm"
        for row in compare_maps(found, truth)
    ]
    said, there = hazards(found), hazards(truth)
    known = (said != UNKNOWN) & (there != UNKNOWN)
    missed = ((said == SAFE) & (there == HAZARD))[known].sum() / max(1, (there == HAZARD)[known].sum())
    feared = ((said == HAZARD) & (there == SAFE))[known].sum() / max(1, (there == SAFE)[known].sum())
    judged = known.sum() / (there != UNKNOWN).sum()
    wrong = f"of hazards {missed:.1%} are missed, of safe places {feared:.1%} are feared"
    return [*lines, f"  {judged:.1%} of the places are judged; {wrong}"]


def figure(found: ElevationMap, truth: ElevationMap):
    """Return the true heights, those found, their difference, and the hazards, as a matplotlib Figure."""
    import matplotlib
    from matplotlib.colors import LightSource, ListedColormap

    made = figures.new_figure(
        figures.PAGE_IN,
        10.8,
        "Lunar descent: what the frames say of the ground",
        f"cells of {CELL_M:g} m, {SIZE_M:g} m across",
    )
    panels = made.subplots(2, 2)
    half = 0.5 * SIZE_M
    span = {"extent": (-half, half, -half, half), "interpolation": "nearest"}
    low, high = np.nanquantile(truth.height_m, (0.005, 0.995))
    light, ends = LightSource(azdeg=70, altdeg=30), {"vmin": low, "vmax": high}
    grounds = (
        (panels[0, 0], truth, "the ground", ""),
        (panels[0, 1], found.fill_holes(), "from the frames", "small holes filled"),
    )
    for axes, ground, title, note in grounds:
        shown = axes.imshow(ground.height_m, cmap=colour_maps.AMOUNT_RAMP, **ends, **span)
        shaded = light.shade(
            ground.height_m,
            matplotlib.colormaps[colour_maps.AMOUNT_RAMP],
            blend_mode="soft",
            vert_exag=2.0,
            dx=CELL_M,
            dy=CELL_M,
            **ends,
        )
        axes.imshow(shaded, **span)
        _key(made, shown, axes, "height [m]")
        figures.style_axes(axes, title, "east [m]", "north [m]", note)
    apart = 100.0 * (found.height_m - truth.height_m)
    shown = panels[1, 0].imshow(apart, cmap=colour_maps.ERROR_RAMP, vmin=-30.0, vmax=30.0, **span)
    _key(made, shown, panels[1, 0], "found less true [cm]")
    figures.style_axes(panels[1, 0], "the difference", "east [m]", "north [m]", "dark: no height")
    panels[1, 0].set_facecolor(palette.NO_RETURN)
    said, there = hazards(found), hazards(truth)
    kinds = np.select(
        [(said == UNKNOWN) | (there == UNKNOWN), (said == SAFE) & (there == SAFE), said == there, said == SAFE],
        [0, 1, 2, 3],
        4,
    )
    colours = {
        "not judged": palette.OTHER_PART,
        "safe": palette.PARTS[9],
        "hazard": palette.NO_RETURN,
        "missed": palette.PARTS[5],
        "feared": palette.PARTS[8],
    }
    panels[1, 1].imshow(kinds, cmap=ListedColormap(list(colours.values())), vmin=-0.5, vmax=4.5, **span)
    figures.style_axes(
        panels[1, 1],
        "where to land",
        "east [m]",
        "north [m]",
        f"{LIMITS['footprint_m']:g} m wide, {LIMITS['slope_deg']:g}°, {LIMITS['roughness_m'] * 100:g} cm",
    )
    for name, colour in colours.items():
        panels[1, 1].plot([], [], "s", color=colour, label=name)
    panels[1, 1].legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.12),
        ncols=5,
        frameon=False,
        fontsize=figures.SMALL_PT,
        labelcolor=palette.QUIET,
        columnspacing=1.0,
    )
    for axes in panels.flat:
        axes.grid(visible=False)
        axes.set_xticks(range(-100, 101, 50))
        axes.set_yticks(range(-100, 101, 50))
    return made


def _key(made, shown, axes, label):
    """Draw the ramp of a panel below it."""
    bar = made.colorbar(shown, ax=axes, location="bottom", shrink=0.8, aspect=40, pad=0.02)
    figures.style_bar(bar, label)


if __name__ == "__main__":
    scenario = rl.Scenario.load(Path(__file__).resolve().parents[1] / "lunar_descent.toml")
    frames = list(rl.simulate(scenario))
    found = build_elevation_map(frames, "site", SIZE_M, CELL_M)
    truth = build_true_elevation(scenario.surfaces[0], found)
    there = hazards(truth)
    print(f"true hazards: {np.mean(there[there != UNKNOWN] == HAZARD):.1%} of the places")
    print("with the true poses", *table(found, truth), sep="\n")
    believed = build_elevation_map(frames, "site", SIZE_M, CELL_M, drifting(len(frames)))
    print(f"with poses that drift by {STEP_M * 100:g} cm a flash", *table(believed, truth), sep="\n")
    for last in (20, 40):
        late = build_elevation_map(frames[-last:], "site", SIZE_M, CELL_M)
        print(f"of the last {last} frames: {late.coverage:.1%} of the cells have a height")
    if len(sys.argv) > 1:
        save_figure(figure(found, truth), sys.argv[1], dpi=figures.SCREEN_DPI)
