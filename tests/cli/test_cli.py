"""The command line: what it prints, what it leaves, and with which status."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import rso_lidar as rl


@pytest.fixture
def scenario(bench):
    return bench


@pytest.fixture
def call(rso_lidar):
    return rso_lidar


def test_version(call):
    assert call("--version") == (0, f"rso-lidar {rl.__version__}\n", [])


def test_help_names_every_command(call):
    _, out, _ = call("--help")
    for command in ["check", "run", "info", "plot", "animate", "models", "schema"]:
        assert command in out


def test_models(call):
    status, out, _ = call("models")
    assert status == 0
    for name in ["tdrs", "juno", "cubesat_3u", "rocket_body"]:
        assert name in out
    line = next(line for line in out.splitlines() if line.split()[:1] == ["envisat"])
    assert line.split()[1:3] == ["payload", "large"]


def test_schema_is_what_the_files_fill(call):
    schema = json.loads(call("schema")[1])
    assert {"version", "time", "target", "follower", "ptu", "lidar"} <= set(schema["properties"])
    assert "energy_mj" in schema["$defs"]["Laser"]["properties"]


def test_check(call, scenario):
    status, out, err = call("check", scenario)
    assert (status, err) == (0, [])
    lines = out.splitlines()
    assert "a plate on a bench" in lines[0]
    assert lines[1] == "verdict     ready to fly, no warnings; plate is found with P 1.00 at first and 1.00 at last"
    assert "P(detect)" in out
    assert max(map(len, lines)) <= 100
    assert not any(line.endswith((" 0.5", " 8", " ->")) or line.lstrip().startswith("-> ") for line in lines)
    assert " ".join(out.split()) == " ".join(rl.Scenario.load(scenario).describe().split())  # folded, and nothing lost


def test_run_info_plot_animate(call, scenario, tmp_path):
    output = tmp_path / "bench.h5"
    status, out, _ = call("run", scenario, "-o", output, "--frames", "0:3")
    assert status == 0
    assert "3 in" in out
    status, out, _ = call("info", output)
    assert status == 0
    for words in ["3, 0 to 0.4 s", "32 x 32", "plate", "complete", "ptu", "lidar"]:
        assert words in out, words
    for arguments, name in [
        (("plot", output), "bench_sheet.png"),
        (("plot", output, "--path"), "bench_path.png"),
        (("plot", output, "--curves"), "bench_curves.png"),
        (("animate", output, tmp_path / "bench.gif"), "bench.gif"),
    ]:
        status, _, err = call(*arguments)
        assert (status, err) == (0, [])
        assert (tmp_path / name).stat().st_size > 1000


def test_frames_seed_and_set(call, scenario, tmp_path):
    call("run", scenario, "-o", tmp_path / "a.h5")
    call("run", scenario, "-o", tmp_path / "b.h5", "--frames", "4:7", "--threads", 1)
    call("run", scenario, "-o", tmp_path / "c.h5", "--frames", "4:7", "--seed", 8)
    call("run", scenario, "-o", tmp_path / "d.h5", "--frames", "4:7", "--set", "lidar.laser.energy_mj=5")
    with (
        rl.open(tmp_path / "a.h5") as a,
        rl.open(tmp_path / "b.h5") as b,
        rl.open(tmp_path / "c.h5") as c,
        rl.open(tmp_path / "d.h5") as d,
    ):
        np.testing.assert_array_equal(b.range_m[:], a.range_m[4:7])
        assert not np.array_equal(c.range_m[:], b.range_m[:], equal_nan=True)
        # Other noise, but the same PTU jitter is drawn from the seed too: geometry agrees to what jitter moves.
        assert c.source.seed == 8
        np.testing.assert_allclose(d.labels.photons[:], b.labels.photons[:] / 10, rtol=1e-6)


def test_every_nth_frame_and_frames_by_their_number(call, scenario, tmp_path):
    output = tmp_path / "thin.h5"
    assert call("run", scenario, "-o", output, "--frames", "1:9:3")[0] == 0
    with rl.open(output) as recording:
        assert recording.frame_index[:].tolist() == [1, 4, 7]
    assert call("plot", output, "--frame", 4)[0] == 0
    assert (tmp_path / "thin_frame4.png").stat().st_size > 1000
    status, _, err = call("plot", output, "--frame", 5)
    assert (status, len(err)) == (2, 1)
    assert "1 to 7" in err[0]


def test_a_run_that_is_complete_has_nothing_to_resume(call, scenario, tmp_path):
    output = tmp_path / "done.h5"
    call("run", scenario, "-o", output)
    before = output.stat().st_mtime_ns
    status, out, _ = call("run", scenario, "-o", output, "--resume")
    assert status == 0
    assert "already" in out
    assert output.stat().st_mtime_ns == before
    status, _, err = call("run", scenario, "-o", output, "--resume", "--seed", 99)
    assert (status, len(err)) == (2, 1)  # another run's recording is in the way


def test_resume_with_other_settings_leaves_the_frames_that_are_there(call, scenario, tmp_path):
    output = tmp_path / "cut.h5"
    flown = rl.Scenario.load(scenario, settings=("seed=7",))
    with pytest.raises(KeyboardInterrupt), rl.export.Recorder(output, flown.source, run_id="1a2b3c4d") as recorder:
        recorder.write(next(iter(rl.simulate(flown))))
        raise KeyboardInterrupt
    status, out, err = call("run", scenario, "-o", output, "--resume")
    assert (status, out, len(err)) == (2, "", 1)
    assert "cut.h5.tmp-1a2b3c4d: holds 1 frame of another run" in err[0]
    assert "--overwrite" in err[0]
    assert [path.name for path in tmp_path.glob("cut*")] == ["cut.h5.tmp-1a2b3c4d"]
    assert call("run", scenario, "-o", output, "--resume", "--overwrite", "--frames", "0:2")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fly",), "No such command"),
        (("run",), "FILE"),
        (("run", "{scenario}"), "--output"),
        (("run", "{scenario}", "-o", "{folder}/none/x.h5"), "no folder"),
        (("run", "{scenario}", "-o", "{folder}"), "suffix"),
        (("run", "{scenario}", "-o", "{folder}/x.txt"), ".h5"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--frames", "a:b"), "A:B"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--frames", "20:30"), "0 to 9"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--threads", "0"), "--threads"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--workers", "0"), "--workers"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--workers", "2", "--threads", "2"), "leave out one"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--set", "lidar.laser.energy_mj=-1"), "energy_mj"),
        (("check", "{folder}/none.toml"), "no such file"),
        (("info", "{folder}/none.h5"), "no such file"),
        (("info", "{scenario}"), "suffix"),
        (("plot", "{folder}/none.h5"), "no such file"),
        (("animate", "{folder}/none.h5", "{folder}/x.gif"), "no such file"),
    ],
)
def test_bad_input_gets_one_line_and_status_2(call, scenario, tmp_path, arguments, words):
    before = sorted(tmp_path.rglob("*"))
    status, _, err = call(*(argument.format(scenario=scenario, folder=tmp_path) for argument in arguments))
    assert status == 2
    assert len(err) == 1
    assert words in err[0]
    assert sorted(tmp_path.rglob("*")) == before, "nothing may be left behind"


def test_an_output_that_exists_is_kept(call, scenario, tmp_path):
    output = tmp_path / "kept.h5"
    output.write_bytes(b"precious")
    status, _, err = call("run", scenario, "-o", output)
    assert (status, len(err)) == (2, 1)
    assert "--overwrite" in err[0]
    assert output.read_bytes() == b"precious"
    assert call("run", scenario, "-o", output, "--overwrite")[0] == 0
    assert output.stat().st_size > 10_000


def _frames_in(path):
    """Return how many frames a recording that is being written holds so far."""
    try:
        with rl.open(path) as part:
            return len(part)
    except (rl.RsoLidarError, OSError):
        return 0


@pytest.mark.slow
def test_a_killed_run_resumes_to_the_same_datasets(call, scenario, tmp_path):
    """Kill a run with SIGKILL once it has frames, resume it, and compare every dataset with an unbroken run's."""
    import h5py

    slow = ("--set", "time.duration_s=20", "--set", "lidar.receiver.rays_per_pixel=400")
    whole, broken = tmp_path / "whole.h5", tmp_path / "broken.h5"
    command = [sys.executable, "-m", "rso_lidar", "run", str(scenario), "-o", str(broken), *slow]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    temporary = []
    while process.poll() is None:
        temporary = [path for path in tmp_path.glob("broken.h5.tmp-*") if not path.name.endswith(".starting")]
        if temporary and _frames_in(temporary[0]) >= 3:
            break
        time.sleep(0.01)
    assert process.poll() is None, "the run ended before it could be killed: make it longer"
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not broken.exists()
    with rl.open(temporary[0]) as part:
        assert not part.complete
        assert 0 < len(part) < 100

    status, out, _ = call("run", scenario, "-o", broken, "--resume", *slow)
    assert status == 0
    assert "continuing after" in out
    assert not list(tmp_path.glob("broken.h5.tmp-*"))
    assert call("run", scenario, "-o", whole, *slow)[0] == 0
    with h5py.File(whole) as a, h5py.File(broken) as b:
        names: list[str] = []
        a.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        assert len(names) > 30
        for name in names:
            np.testing.assert_array_equal(a[name][()], b[name][()], err_msg=name)


class TestKeep:
    NAMES = ("photons", "waveforms", "oversampled")

    def test_it_writes_and_reads_back(self, call, scenario, tmp_path):
        output = tmp_path / "kept.h5"
        assert call("run", scenario, "-o", output, "--keep", ", ".join(self.NAMES), "--frames", "0:3")[0] == 0
        assert "waveforms" in call("info", output)[1]
        with rl.open(output) as recording:
            flight = rl.simulate(rl.Scenario.load(scenario), keep=self.NAMES, frames=range(3))
            for written, made in zip(recording, flight, strict=True):
                assert set(written.kept) == set(self.NAMES)
                one, two = written.kept["waveforms"], made.kept["waveforms"]
                np.testing.assert_array_equal(one.samples_counts, two.samples_counts)
                np.testing.assert_array_equal(one.pixel, two.pixel)
                np.testing.assert_array_equal(one.start_s, two.start_s)
                # Photons are recorded as an image: that of the labels.
                np.testing.assert_allclose(written.kept["photons"].photons, made.labels.photons, rtol=1e-6)
                np.testing.assert_array_equal(written.kept["oversampled"].range_m, made.kept["oversampled"].range_m)

    @pytest.mark.parametrize(
        ("keep", "more", "words"),
        [
            ("photon", (), "did you mean 'photons'"),
            ("photons,rays", (), "cannot keep 'rays'"),
            ("", (), "names nothing"),
            (" , ", (), "names nothing"),
            ("waveforms", ("--set", "lidar.detector.type=empirical"), "has no waveforms"),
        ],
    )
    def test_what_cannot_be_kept(self, call, scenario, tmp_path, keep, more, words):
        before = sorted(tmp_path.rglob("*"))
        status, _, err = call("run", scenario, "-o", tmp_path / "x.h5", "--keep", keep, *more)
        assert (status, len(err)) == (2, 1)
        assert words in err[0]
        assert sorted(tmp_path.rglob("*")) == before

    def test_a_run_that_was_cut_off_goes_on(self, call, scenario, tmp_path, monkeypatch):
        import h5py

        import rso_lidar.cli.run as command

        def cut_off(*arguments, **options):
            for frame in rl.simulate(*arguments, **options):
                if frame.index == 6:
                    raise KeyboardInterrupt
                yield frame

        whole, broken = tmp_path / "whole.h5", tmp_path / "broken.h5"
        keep = ("--keep", "waveforms,photons", "--set", "lidar.schedule={time_s=[0, 1], focal_length_mm=[70, 110]}")
        with monkeypatch.context() as patch:
            patch.setattr(command, "simulate", cut_off)
            status, _, err = call("run", scenario, "-o", broken, *keep)
        assert status == 130
        assert "--resume" in err[-1]
        status, out, _ = call("run", scenario, "-o", broken, "--resume", *keep)
        assert (status, "continuing after 6 of 10" in out) == (0, True)
        assert call("run", scenario, "-o", whole, *keep)[0] == 0
        with h5py.File(whole) as a, h5py.File(broken) as b:
            names: list[str] = []
            a.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
            assert any("waveforms" in name for name in names)
            for name in names:
                np.testing.assert_array_equal(a[name][()], b[name][()], err_msg=name)

    def test_a_complete_run_without_them_is_not_what_was_asked_for(self, call, scenario, tmp_path):
        output = tmp_path / "bare.h5"
        call("run", scenario, "-o", output)
        assert call("run", scenario, "-o", output, "--resume")[0] == 0
        status, _, err = call("run", scenario, "-o", output, "--resume", "--keep", "photons")
        assert (status, len(err)) == (2, 1)
        assert "--overwrite" in err[0]
        assert call("run", scenario, "-o", output, "--overwrite", "--keep", "photons")[0] == 0
        assert "already" in call("run", scenario, "-o", output, "--resume", "--keep", "photons")[1]


class TestChangingLens:
    ZOOM = "lidar.schedule={time_s=[0, 1], focal_length_mm=[70, 110]}"

    def test_run_and_save_record_the_lines_of_sight_that_were_in_force(self, call, scenario, tmp_path):
        made = list(rl.simulate(rl.Scenario.load(scenario, (self.ZOOM,))))
        rl.save(tmp_path / "saved.h5", iter(made))
        assert call("run", scenario, "-o", tmp_path / "run.h5", "--set", self.ZOOM)[0] == 0
        for name in ("run.h5", "saved.h5"):
            # 0, 0.2 ... 1 s, and the same from there on.
            assert "6 tables of lines of sight" in call("info", tmp_path / name)[1]
            with rl.open(tmp_path / name) as recording:
                for written, frame in zip(recording, made, strict=True):
                    np.testing.assert_allclose(written.line_of_sight, frame.line_of_sight, rtol=1e-6)
                    np.testing.assert_array_equal(written.range_m, frame.range_m)
                    assert written.observation.settings == pytest.approx(frame.observation.settings, rel=1e-12)
        for arguments in (
            ("plot", tmp_path / "run.h5", "--frame", 3),
            ("animate", tmp_path / "run.h5", tmp_path / "run.gif"),
        ):
            assert call(*arguments)[0] == 0


# What an instrument may be told that it cannot be: settings, and words that the one line holds.
BAD_INSTRUMENTS = [
    ("lidar.preset=gsfl_1604", "did you mean 'gsfl_1064'"),
    ("lidar.preset=3", "lidar.preset"),
    ("lidar.schedule={time_s=[0, 1]}", "no setting is planned"),
    ("lidar.schedule={time_s=[0, 1], energy_mj=[1]}", "match them"),
    ("lidar.schedule={time_s=[0, 1], energy_mj=5}", "needs a list"),
    ("lidar.schedule={time_s=[0], gate_delay_ns=[1]}", "[lidar.detector.gate]"),
    ('lidar.receiver.psf={type="gauss"}', "'gaussian'"),
    ('lidar.receiver.psf={type="gaussian"}', "sigma_um"),
    ('lidar.receiver.psf={type="gaussian", sigma_um=1e9}', "psf: only"),
    ('lidar.receiver.psf={type="grid", file="none.csv", spacing_um=10}', "no file 'none.csv'"),
    ('lidar.receiver.psf={type="grid", file="bench.toml", spacing_um=10}', "bench.toml"),
    ('lidar.receiver.psf={type="zemax_huygens", file="bench.toml"}', "bench.toml"),
    ('lidar.receiver.psf={type="field_dependent", fields=[]}', "fields"),
    ('lidar.receiver.distortion={type="brown_conrady", k1=-9000}', "distortion"),
    ('lidar.receiver.distortion={type="zemax_grid", file="bench.toml"}', "Grid Distortion"),
    ("lidar.receiver.filter_width_nm=0", "filter_width_nm"),
    ("lidar.receiver.aperture_mm=5", "exactly one"),
    ('lidar.laser.pulse_shape="measured"', "pulse_file"),
    ('lidar.laser.pulse_file="x.csv"', "not used"),
    ('lidar.laser.footprint="pattern"', "pattern_file"),
    ("lidar.laser.pulse_fwhm_ns=1e9", "steps of time"),
    ("lidar.laser.offset_m=[1, 2]", "offset_m"),
    ("lidar.laser.energy_jitter_fraction=2", "energy_jitter_fraction"),
    ("lidar.detector.preset=quiet", "offset_limited"),
    ("lidar.detector.gate={}", "delay_ns"),
    ("lidar.detector.gate={delay_ns=-1}", "delay_ns"),
    ("lidar.detector.gate={delay_ns=1, width_ns=1e9}", "width_ns"),
    ("lidar.detector.gate={delay_ns=1, false_alarm_probability=1}", "false_alarm_probability"),
    ("lidar.detector.trigger.threshold_electrons=100", "times a second"),
    ("lidar.detector.armed_to_m=0.5", "armed_from_m"),
    ("lidar.detector.returns=best", "strongest"),
    ("lidar.detector.max_returns=9", "max_returns"),
    ("lidar.detector.readout.samples=7", "samples"),
    ("lidar.detector.readout.baseline_counts=4000", "baseline_counts"),
    ("lidar.detector.quantum_efficiency=1.1", "quantum_efficiency"),
    ("lidar.detector.ranging.algorithm=fft", "matched_filter"),
    ("lidar.detector.speckle=3", "needs a table"),
    ("world.sun_direction=[0, 0, 0]", "zero vector"),
]


@pytest.mark.parametrize(("setting", "words"), BAD_INSTRUMENTS)
def test_check_refuses_a_bad_instrument_with_one_line(call, scenario, setting, words):
    status, out, err = call("check", scenario, "--set", setting)
    assert (status, out, len(err)) == (2, "", 1)
    assert err[0].startswith("error: bench.toml: ")
    assert words in err[0]


def test_check_warns_of_a_gate_that_misses(call, scenario):
    status, out, _ = call("check", scenario, "--set", "lidar.detector.gate={delay_ns=100}")
    assert status == 0
    lines = out.splitlines()
    assert lines[1].startswith("verdict     flies, with 1 warning; plate is found with P 0.")
    assert lines[2].startswith("warning     target plate: the range gate")
