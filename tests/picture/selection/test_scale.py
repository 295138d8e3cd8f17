from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.picture import Scale, Thumbnail
from rso_lidar.picture.style.colour_maps import FAINTEST, apply_ramp, fixed_palette, ramp
from rso_lidar.picture.style.palette import NO_RETURN, split_rgb
from rso_lidar.records import Reading


def test_paint_clips_and_marks_what_is_missing():
    colours = apply_ramp(np.array([-1.0, 0.0, 0.5, 1.0, 2.0, np.nan]), "viridis", NO_RETURN)
    assert (colours[0] == colours[1]).all()
    assert (colours[3] == colours[4]).all()
    assert (colours[3] == ramp("viridis")[255]).all()
    assert tuple(colours[5]) == split_rgb(NO_RETURN)
    # A missing return cannot be taken for a range: its grey is well off every colour of the ramp.
    assert np.abs(ramp("viridis").astype(int) - split_rgb(NO_RETURN)).max(axis=1).min() > 25


def test_greys_of_intensity_begin_above_black():
    assert (ramp("gray")[0] == FAINTEST).all()
    assert (ramp("gray")[255] == 255).all()


def test_the_fixed_palette_has_256_colours_near_all_that_is_drawn():
    palette = np.array(fixed_palette()).reshape(-1, 3)
    assert len(palette) == 256
    for name in ("viridis", "gray"):
        gaps = np.abs(ramp(name)[:, None].astype(int) - palette[None]).max(axis=-1).min(axis=1)
        assert gaps.max() <= 4


def test_an_approach_is_drawn_about_each_median(handmade, coming):
    scale = Scale.of([Thumbnail.of(frame) for frame in coming])
    assert scale.relative
    assert scale.low_m == -scale.high_m
    assert 1.0 < scale.high_m <= 10.0  # the satellite reaches 6.5 m from its origin
    assert scale.logarithmic
    middle = scale.range_rgb(np.array([1000.0]), 1000.0)
    assert np.abs(middle[0].astype(int) - ramp("viridis")[128]).max() <= 2
    assert scale.range_words[1].startswith("≤ −")


def test_a_look_from_one_place_is_drawn_by_range_itself(handmade):
    thumbnails = [Thumbnail.of(handmade.make_frame(10.0 * k, 500.0, 64, index=k)) for k in range(4)]
    scale = Scale.of(thumbnails)
    assert not scale.relative
    seen = np.concatenate([g.range_m[g.on_target] for g in thumbnails])
    assert ((seen >= scale.low_m) & (seen <= scale.high_m)).mean() > 0.97
    ends_m = [np.percentile(g.range_m[g.on_target], (1, 99)) for g in thumbnails]
    assert scale.low_m <= np.min(ends_m) < np.max(ends_m) <= scale.high_m  # rounded outward
    assert not scale.logarithmic
    assert scale.low_counts == 0


def test_nothing_seen_still_has_a_scale(handmade):
    dark = handmade.make_frame(0.0, 500.0, 32, photons_at_km=0.0, false_returns=0)
    scale = Scale.of([Thumbnail.of(dark)])
    assert (scale.range_rgb(dark.range_m, float("nan")) == split_rgb(NO_RETURN)).all()
    assert (scale.intensity_rgb(dark.intensity_counts) == 0).all()


def strays(handmade, seed):
    """A frame of false returns alone, far from one another."""
    frame = handmade.make_frame(0.0, 500.0, 64, photons_at_km=0.0, labelled=False, false_returns=6, index=seed)
    return Thumbnail.of(frame)


def test_stray_returns_alone_have_a_scale_of_their_own(handmade):
    thumbnails = [strays(handmade, seed) for seed in range(4)]
    assert not any(thumbnail.on_target.any() for thumbnail in thumbnails)
    scale = Scale.of(thumbnails)
    ranges_m = np.concatenate([g.range_m[np.isfinite(g.range_m)] for g in thumbnails])
    counts = np.concatenate([g.intensity_counts[g.intensity_counts > 0] for g in thumbnails])
    assert not scale.relative
    assert scale.low_m <= np.percentile(ranges_m, 5) < np.percentile(ranges_m, 95) <= scale.high_m
    assert scale.high_counts >= np.percentile(counts, 95) > 20  # the false returns made by hand have 20 to 60 counts


@pytest.mark.parametrize("logarithmic", [True, False])
def test_intensity_runs_from_faint_to_white(logarithmic):
    scale = Scale(True, -1, 1, 10.0, 1000.0, logarithmic)
    faint, middle, bright, none = scale.intensity_rgb(np.array([10, 100, 1000, 0]))[:, 0]
    assert (faint, bright, none) == (FAINTEST, 255, 0)
    share = 0.5 if logarithmic else 90 / 990
    assert middle == pytest.approx(FAINTEST + share * (255 - FAINTEST), abs=1.5)


@pytest.fixture(scope="module")
def pair(handmade):
    """A frame with 8 weak returns near 900 m, and one with 391 returns from 1000 to 1010 m of up to 4000 counts."""
    seen = handmade.make_frame(labelled=False)
    frames = []
    for top, count, across, ends_m, ends_counts in (
        (16, 8, 4, (900.0, 900.7), (20, 27)),
        (96, 391, 20, (1000.0, 1010.0), (100, 4000)),
    ):
        range_m, counts = np.full((128, 128), np.nan), np.zeros((128, 128))
        at = divmod(np.arange(count), across)
        place = at[0] + top, at[1] + top
        range_m[place], counts[place] = np.linspace(*ends_m, count), np.linspace(*ends_counts, count)
        reading = Reading(range_m=range_m, intensity_counts=counts, saturated=np.zeros((128, 128), bool))
        frames.append(replace(seen, observation=replace(seen.observation, reading=reading)))
    return frames[0], frames[1]


def test_the_scale_of_two_frames_spans_both(pair):
    weak, strong = pair
    scale = Scale.of_frames(weak, strong)
    # Percentiles of even steps: 900 m + 1 % of 0.7 m, 1000 m + 99 % of 10 m; 20 + 2 % of 7, 100 + 99.5 % of 3900 counts.
    assert (scale.low_m, scale.high_m) == pytest.approx((900.007, 1009.9), abs=1e-3)
    assert (scale.low_counts, scale.high_counts, scale.logarithmic) == (20.0, 3981.0, True)
    assert Scale.of_frames(strong, weak) == scale
    assert Scale.of_frames(weak).high_m == pytest.approx(900.693, abs=1e-3)


def test_eight_weak_returns_leave_the_other_frame_its_colours(pair):
    weak, strong = pair
    alone, both = Scale.of_frames(weak), Scale.of_frames(weak, strong)
    colours = [len(np.unique(scale.range_rgb(strong.range_m, 0.0)[strong.valid], axis=0)) for scale in (alone, both)]
    assert colours == [1, 24]  # 9.9 of 109.9 m of a ramp of 256 are 23 steps
    assert alone.intensity_fraction(strong.intensity_counts[strong.valid]).min() > 1.0  # all of it white
    faintest, brightest = both.intensity_fraction(np.array([100.0, 3981.0]))
    assert (faintest, brightest) == pytest.approx((np.log(100 / 20) / np.log(3981 / 20), 1.0))
