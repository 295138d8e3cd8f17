"""What `check` says of stray light: the noise that it adds, and what frames show of it."""

import pytest

import rso_lidar as rl

BENCH = (
    'lidar.detector.type="gsfl"',
    "lidar.receiver.filter_width_nm=300.0",
    "lidar.receiver.glare.surfaces=8",
)


def bench(*more):
    return rl.Scenario.load("examples/bench_plate.toml", (*BENCH, *more))


def sun_at(x, y, z):
    return f"world.sun_direction=[{x}, {y}, {z}]"


def lines_about(word, scenario):
    return [line for line in scenario.advice() if word in line]


def test_the_sun_beside_the_field_is_reported_by_its_noise():
    """At 4 degrees off the boresight (+x of the root) the lens scatters enough to be heard; from behind nothing."""
    loud = "lidar.receiver.glare.peak_per_sr=4.0"
    (line,) = lines_about("glare, mostly of the Sun,", bench(sun_at(1, 0.07, 0), loud))
    assert "makes the noise of a pixel" in line and "add lidar.receiver.glare.baffle" in line
    assert not lines_about("stray light is not in the frames", bench(sun_at(1, 0.07, 0)))
    assert not lines_about("glare", bench(sun_at(-1, 0.07, 0)))


def test_a_baffle_silences_the_warning():
    far = sun_at(1.0, 0.27, 0.0)
    loud = "lidar.receiver.glare.peak_per_sr=4.0"
    assert lines_about("glare, mostly of the Sun,", bench(far, loud))
    lens_mm = bench().lidar.receiver.aperture_m * 1e3
    size = f"length_mm = {8 * lens_mm}, diameter_mm = {1.6 * lens_mm}"
    shade = f"lidar.receiver.glare.baffle={{ {size}, leak_fraction = 1e-6 }}"
    assert not lines_about("glare", bench(far, loud, shade))


def test_the_sun_in_the_field():
    scenario = bench(sun_at(1, 0.005, 0))
    (line,) = lines_about("the Sun is in the field of view", scenario)
    assert "frames show its light, not the damage" in line
    (noise,) = lines_about("light of the sky in the field", scenario)
    assert "times that in the dark" in noise


def test_a_world_without_a_sun():
    (line,) = lines_about("lidar.receiver.glare", bench())
    assert "set world.sun_direction" in line


def test_the_description_names_ghosts_and_glare():
    text = bench("lidar.receiver.ghosts=[{ fraction = 0.01 }, { fraction = 0.002, offset_pixels = [3, 0] }]").describe()
    assert "ghosts of 1 %, 0.2 %" in text
    assert "glare of sun earth moon, 0.9 % scattered" in text


@pytest.mark.parametrize("sources", ['["earth"]', '["moon"]'])
def test_a_sun_whose_glare_is_left_out_is_warned_of_as_without_glare(sources):
    scenario = bench(sun_at(1, 0.005, 0), f"lidar.receiver.glare.sources={sources}")
    (line,) = lines_about("the Sun is in the field of view", scenario)
    assert "no frame shows that" in line


def test_a_local_world_has_neither_earth_nor_moon():
    moon = bench(sun_at(1, 0.07, 0), 'lidar.receiver.glare.sources=["moon"]')
    (line,) = lines_about("lidar.receiver.glare.sources", moon)
    assert 'add "sun"' in line
