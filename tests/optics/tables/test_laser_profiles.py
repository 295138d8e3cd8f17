"""Measured laser patterns and pulses: what a file becomes, and the one line that a bad one gets."""

import math
import os

import numpy as np
import pytest
from PIL import Image

import rso_lidar as rl
from rso_lidar.cli import main
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Laser, read_pattern
from rso_lidar.optics.tables.laser_profiles import find_full_width_s, read_pulse

# ------------------------------------------------------------------------------------------------------------ patterns

RAMP = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])  # every cell its own value: a turned or mirrored reading shows


def image(path, values, kind):
    Image.fromarray(np.asarray(values).astype(kind)).save(path)
    return path


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("p.png", lambda path: image(path, 20 * RAMP, np.uint8)),
        ("p16.png", lambda path: image(path, 9000 * RAMP, np.uint16)),
        ("p.tif", lambda path: image(path, 9000 * RAMP, np.uint16)),
        ("float.tiff", lambda path: image(path, 0.01 * RAMP, np.float32)),
        ("rgb.PNG", lambda path: image(path, np.repeat(20 * RAMP[..., None], 3, axis=2), np.uint8)),
        ("p.csv", lambda path: path.write_text("1,2,3\n4,5,6\n")),
        ("head.csv", lambda path: path.write_text("# beam profile\nleft,middle,right\n1e0, 2, 3\n\n4, 5, 6.0\n")),
        ("blank.txt", lambda path: path.write_text("1 2 3\r\n4\t5  6\r\n")),
        ("german.csv", lambda path: path.write_text("0,1;0,2;0,3\n0,4;0,5;0,6\n")),
        ("mark.csv", lambda path: path.write_text("1;2;3\n4;5;6\n", encoding="utf-8-sig")),
        ("utf16.txt", lambda path: path.write_text("1\t2\t3\n4\t5\t6\n", encoding="utf-16")),
        ("huge.csv", lambda path: path.write_text("1e306,2e306,3e306\n4e306,5e306,6e306\n")),
    ],
)
def test_a_pattern_in_many_hands(tmp_path, name, write):
    """The same six numbers, whatever the file: shares of the energy, row 0 at the top."""
    write(tmp_path / name)
    pattern = read_pattern(str(tmp_path / name))
    assert pattern == pytest.approx(RAMP / 21, rel=1e-6)  # float32 of the .tiff
    assert math.fsum(pattern.ravel()) == pytest.approx(1, abs=1e-15)
    assert not pattern.flags.writeable


@pytest.mark.parametrize("divergence_deg", [0.05, 2.5, 45.0])
def test_a_pattern_sends_all_the_energy_and_none_beside(tmp_path, divergence_deg):
    (tmp_path / "p.csv").write_text("1,2,3\n4,5,6\n")
    laser = Laser(footprint="pattern", pattern_file=str(tmp_path / "p.csv"), divergence_deg=divergence_deg)
    t = laser.half_width_tangent
    x, y = ((2 * (np.arange(n) + 0.5) / n - 1) * t for n in (30, 20))
    density = laser.density(x[None, :], y[:, None])
    assert density.sum() * 4 * t * t / 600 == pytest.approx(laser.photons, rel=1e-12)
    beside = 1.0000001 * t
    assert np.all(laser.density(np.array([beside, -beside, 0, 0]), np.array([0, 0, beside, -beside])) == 0)


def test_a_pattern_lies_as_the_lidar_sees_it(tmp_path):
    """Lidar axes: x to the right, y down (conventions.md). Row 0 of the file is at the top, its first value at the left."""
    image(tmp_path / "p.png", 20 * RAMP, np.uint8)
    laser = Laser(footprint="pattern", pattern_file=str(tmp_path / "p.png"))
    t, cell = laser.half_width_tangent, laser.photons / (4 * laser.half_width_tangent**2 / 6)
    for (x, y), value in {
        (-0.99, -0.99): 1,
        (0.0, -0.01): 2,
        (0.99, -0.99): 3,
        (-0.34, 0.01): 4,
        (-0.33, 0.5): 5,
        (0.99, 0.99): 6,
        (1.0, 1.0): 6,  # the edge belongs to the beam
    }.items():
        assert float(laser.density(np.array(x * t), np.array(y * t))) == pytest.approx(value / 21 * cell, rel=1e-12)


def test_a_changed_pattern_is_read_again(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("1,1\n1,1\n")
    assert read_pattern(str(path))[0, 0] == 0.25
    path.write_text("3,1\n1,1\n# now other\n")
    assert read_pattern(str(path))[0, 0] == pytest.approx(0.5, rel=1e-15)


# -------------------------------------------------------------------------------------------------------------- pulses


def write_pulse(path, time_ns, power):
    path.write_text("time_ns,power\n" + "".join(f"{t:.9g},{p:.9g}\n" for t, p in zip(time_ns, power, strict=True)))
    return Laser(pulse_shape="measured", pulse_file=str(path), pulse_fwhm_ns=77.0)


def test_samples_of_a_skewed_pulse_have_their_centroid_at_zero(tmp_path):
    """Linear pieces sampled evenly have another centroid than their rows, here by 0.15 ps: 23 um of range."""
    step_s, taps = write_pulse(tmp_path / "skew.csv", [0, 1, 2, 9, 30], [0, 1, 0.9, 0.05, 0]).pulse
    time_s = (np.arange(len(taps)) - len(taps) // 2) * step_s
    assert np.average(time_s, weights=taps) == pytest.approx(0.0, abs=1e-14)


def test_a_gaussian_measured_is_the_gaussian(tmp_path):
    """A Gaussian of 6 ns written every 0.05 ns, anywhere on the clock, in any unit: width, centre and shape come back."""
    time_ns = np.arange(100, 140, 0.05)
    laser = write_pulse(tmp_path / "g.csv", time_ns, 37 * np.exp(-4 * math.log(2) * ((time_ns - 121.3) / 6) ** 2))
    step_s, power = laser.pulse
    time = (np.arange(len(power)) - len(power) // 2) * step_s
    assert laser.pulse_fwhm_s == pytest.approx(6e-9, rel=1e-4)  # straight lines between rows: (0.05/6)^2
    assert power.sum() * step_s == pytest.approx(1, rel=1e-12)
    assert np.sum(power * time) * step_s == pytest.approx(0, abs=1e-15)
    assert step_s == pytest.approx(0.05e-9, rel=0.05)
    s = 6e-9 / math.sqrt(8 * math.log(2))
    assert np.sum(power * time**2) * step_s == pytest.approx(s**2, rel=1e-3)
    bell = np.exp(-0.5 * (time / s) ** 2) / (s * math.sqrt(2 * math.pi))
    assert np.abs(power - bell).max() < 1e-3 * bell.max()
    assert not power.flags.writeable


def test_a_triangle_in_three_rows(tmp_path):
    """Rise 2 ns, fall 6 ns: width at half 4 ns, centroid (2 + 8)/3 ns after the first row, by geometry."""
    laser = write_pulse(tmp_path / "t.csv", [10, 12, 18], [0, 5, 0])
    time_s, power = read_pulse(laser.pulse_file)
    assert find_full_width_s(time_s, power) == pytest.approx(4e-9, rel=1e-12)
    assert time_s == pytest.approx(np.array([-10 / 3, -4 / 3, 14 / 3]) * 1e-9, rel=1e-12)
    assert power.max() == pytest.approx(1 / 4e-9, rel=1e-12)
    step_s, taps = laser.pulse
    time = (np.arange(len(taps)) - len(taps) // 2) * step_s
    assert abs(np.sum(taps * time) * step_s) < 1e-4 * 4e-9
    assert np.interp(0.0, time, taps) == pytest.approx((14 / 18) / 4e-9, rel=1e-3)
    assert step_s <= 4e-9 / 48


@pytest.mark.parametrize("step_ns", [1.0, 2.0])
def test_coarse_rows_keep_width_and_centre(tmp_path, step_ns):
    """An 8 ns pulse by a 1 or 0.5 GHz scope: its straight pieces, no more, and centred to 1e-4 of its width."""
    time_ns = np.arange(-30, 31, step_ns) + 0.3
    laser = write_pulse(tmp_path / "c.csv", time_ns, np.exp(-4 * math.log(2) * (time_ns / 8) ** 2))
    step_s, taps = laser.pulse
    time = (np.arange(len(taps)) - len(taps) // 2) * step_s
    assert laser.pulse_fwhm_s == pytest.approx(8e-9, rel=0.01 * step_ns**2)
    assert abs(np.sum(taps * time) * step_s) < 1e-4 * 8e-9


def test_long_dark_tails_cost_no_resolution(tmp_path):
    """100 us of zeros about an 8 ns pulse: the taps are about the pulse."""
    time_ns = np.concatenate([[-50_000.0], np.arange(-20, 20.1, 0.5), [50_000.0]])
    power = np.exp(-4 * math.log(2) * (time_ns / 8) ** 2)
    power[np.abs(time_ns) > 19] = 0.0
    step_s, taps = write_pulse(tmp_path / "l.csv", time_ns, power).pulse
    assert step_s < 0.51e-9 and len(taps) < 300


def test_a_pulse_cut_off_upright(tmp_path):
    """A box of 10 ns: its width is from end to end, and nothing lies outside."""
    laser = write_pulse(tmp_path / "b.csv", [0, 5, 10], [1, 1, 1])
    assert laser.pulse_fwhm_s == pytest.approx(10e-9, rel=1e-12)
    _, taps = laser.pulse
    assert taps.max() == pytest.approx(1 / 10e-9, rel=0.03)  # a tap more or less at the ends


def test_a_changed_pulse_is_read_again(tmp_path):
    laser = write_pulse(tmp_path / "p.csv", [0, 2, 4], [0, 1, 0])
    assert laser.pulse_fwhm_s == pytest.approx(2e-9)
    write_pulse(tmp_path / "p.csv", [0, 4.0, 8.0], [0, 1, 0.0])
    os.utime(tmp_path / "p.csv", (1, 1))
    assert laser.pulse_fwhm_s == pytest.approx(4e-9)


# ----------------------------------------------------------------------------------------------------------- bad files

PNG = b"\x89PNG\r\n\x1a\n"
BAD_PATTERNS = {
    "empty.csv": (b"", "contains no numbers"),
    "heading.csv": (b"a,b,c\n", "contains no numbers"),
    "one_row.csv": (b"1,2,3\n", "needs rows and columns"),
    "one_column.csv": (b"1\n2\n3\n", "needs rows and columns"),
    "ragged.csv": (b"1,2\n3,4\n5\n", "row 3 has 1 values, the first 2"),
    "word.csv": (b"1,2\n3,four\n", "row 2: 'four' is not a number"),
    "negative.csv": (b"1,2\n3,-4\n", "finite values, none negative"),
    "nan.csv": (b"1,2\n3,nan\n", "finite values, none negative"),
    "inf.csv": (b"1,2\n3,inf\n", "finite values, none negative"),
    "dark.csv": (b"0,0\n0,0\n", "and some positive"),
    "binary.csv": (PNG + bytes(range(256)), "is not text"),
    "empty.png": (b"", "cannot be read as an image"),
    "cut.png": (PNG + b"\x00\x00\x00\rIHDR\x00\x00", "cannot be read as an image"),
    "text.png": (b"1,2\n3,4\n", "cannot be read as an image"),
    "list.tif": (b"II*\x00\x08\x00\x00\x00\xff\xff", "cannot be read as an image"),
    "bitmap.bmp": (b"BM" + b"\xff" * 60, "cannot be read as an image"),
}
BAD_PULSES = {
    "empty.csv": (b"", "contains no numbers"),
    "three.csv": (b"0,0,0\n1,1,1\n2,0,0\n", "two columns"),
    "two_rows.csv": (b"0,1\n1,1\n", "three rows"),
    "back.csv": (b"0,0\n2,1\n1,0\n", "must be finite and ascend"),
    "twice.csv": (b"0,0\n1,1\n1,0\n", "must be finite and ascend"),
    "below.csv": (b"0,0\n1,1\n2,-0.1\n", "subtract the baseline"),
    "dark.csv": (b"0,0\n1,0\n2,0\n", "subtract the baseline"),
    "nan.csv": (b"0,0\n1,nan\n2,0\n", "finite"),
    "word.csv": (b"0,0\n1,peak\n2,0\n", "'peak' is not a number"),
    "ragged.csv": (b"0,0\n1\n2,0\n", "row 2 has 1 values"),
    "tails.csv": (b"-9999,0.001\n-4,0.001\n0,1\n4,0.001\n9999,0.001\n", "shorten its tails"),
}


def one_line(error, *words):
    line = str(error)
    assert "\n" not in line and len(line) < 300
    for word in words:
        assert word in line, f"no {word!r} in {line!r}"


@pytest.mark.parametrize("name", BAD_PATTERNS)
def test_a_bad_pattern_gets_one_line(tmp_path, name):
    content, told = BAD_PATTERNS[name]
    (tmp_path / name).write_bytes(content)
    laser = Laser(footprint="pattern", pattern_file=str(tmp_path / name))
    with pytest.raises(ScenarioError) as caught:
        laser.density(np.zeros(1), np.zeros(1))
    one_line(caught.value, name, told, ";")


@pytest.mark.parametrize("cut", [30, 60, 120])
def test_a_truncated_image_gets_one_line(tmp_path, cut):
    whole = image(tmp_path / "whole.png", np.random.default_rng(1).integers(0, 255, (40, 40)), np.uint8).read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[:cut])
    with pytest.raises(ScenarioError) as caught:
        read_pattern(str(tmp_path / "cut.png"))
    one_line(caught.value, "cut.png", "cannot be read as an image")


@pytest.mark.parametrize("name", BAD_PULSES)
def test_a_bad_pulse_gets_one_line(tmp_path, name):
    content, told = BAD_PULSES[name]
    (tmp_path / name).write_bytes(content)
    laser = Laser(pulse_shape="measured", pulse_file=str(tmp_path / name))
    with pytest.raises(ScenarioError) as caught:
        _ = laser.pulse
    one_line(caught.value, name, told, ";")


def test_a_folder_and_nothing(tmp_path):
    (tmp_path / "folder.csv").mkdir()
    for read in (read_pattern, read_pulse):
        for name in ("folder.csv", "nothing.csv"):
            with pytest.raises(ScenarioError) as caught:
                read(str(tmp_path / name))
            one_line(caught.value, name)


PATTERN, PULSE = 'footprint = "pattern"\npattern_file = ', 'pulse_shape = "measured"\npulse_file = '


def test_a_scenario_finds_and_reads_its_files(text, tmp_path):
    (tmp_path / "beam.csv").write_text("1,2,3\n4,5,6\n")
    (tmp_path / "pulse.csv").write_text("0,0\n5,1\n9,0\n")
    said = text.replace("energy_mj = 50", f'{PATTERN}"beam.csv"\n{PULSE}"pulse.csv"')
    laser = rl.Scenario.loads(said, folder=tmp_path).instrument.laser
    assert laser.pattern_file == str(tmp_path / "beam.csv")
    assert laser.pulse_fwhm_s == pytest.approx(4.5e-9, rel=1e-12)
    frame = next(iter(rl.simulate(rl.Scenario.loads(said, folder=tmp_path), threads=1)))
    assert frame.observation.settings["pulse_fwhm_s"] == pytest.approx(4.5e-9, rel=1e-12)


@pytest.mark.parametrize(
    ("said", "content", "told"),
    [
        (f'{PATTERN}"bad.csv"', b"1,2\n3\n", "row 2 has 1 values"),
        (f'{PATTERN}"bad.png"', b"none", "cannot be read as an image"),
        (f'{PATTERN}"lost.csv"', None, "no file 'lost.csv'"),
        (f'{PULSE}"bad.csv"', b"1,2\n3,4\n", "three rows"),
        (f'{PULSE}"lost.csv"', None, "no file 'lost.csv'"),
        ('footprint = "pattern"', None, "needs pattern_file"),
        ('pulse_shape = "measured"', None, "needs pulse_file"),
        ('pattern_file = "bad.csv"', b"1,1\n1,1\n", "is given but not used"),
        ('pulse_file = "bad.csv"', b"0,0\n1,1\n2,0\n", "is given but not used"),
    ],
)
@pytest.mark.parametrize("command", [("check",), ("run", "-o", "out.h5")])
def test_the_command_line_says_it_in_one_line(text, tmp_path, monkeypatch, capsys, said, content, told, command):
    monkeypatch.chdir(tmp_path)
    if content is not None:
        (tmp_path / said.split('"')[-2]).write_bytes(content)
    (tmp_path / "bench.toml").write_text(text.replace("energy_mj = 50", said))
    with pytest.raises(SystemExit) as left:
        main([command[0], "bench.toml", *command[1:]])
    printed = capsys.readouterr().err.splitlines()
    assert left.value.code == 2
    assert len(printed) == 1, printed
    one_line(printed[0], "bench.toml", told)
    assert not (tmp_path / "out.h5").exists()
