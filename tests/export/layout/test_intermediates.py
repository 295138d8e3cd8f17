"""What a recording holds only if the frames do: all returns, waveforms, photon images, oversampled images, sunlight."""

import dataclasses

import h5py
import numpy as np
import pytest
from frames_for_tests import (
    FINER,
    KEEP,
    RETURNS,
    SAMPLES,
    SOURCE,
    assert_same,
    datasets,
    leave_unfinished,
    make_frame,
    make_frames,
)

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export.layout import intermediates
from rso_lidar.records import Hits, Photons, Rays, Waveforms

RUN = "1a2b3c4d"
FULL = {"returns": True, "keep": KEEP}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return export.save(tmp_path_factory.mktemp("kept") / "run.h5", make_frames(5, **FULL))


@pytest.fixture
def recording(saved):
    with export.open(saved) as recording:
        yield recording


def with_kept(frame, **kept):
    return dataclasses.replace(frame, kept={**frame.kept, **kept})


# ------------------------------------------------------------------------------------------------------ round trips


def test_every_frame_comes_back_with_all_it_kept(recording):
    for k, frame in enumerate(recording):
        assert_same(frame, make_frame(k, **FULL))
    waveforms = recording[3].kept["waveforms"]
    assert isinstance(waveforms, Waveforms)
    assert waveforms.pixel.dtype == np.dtype("i4")
    assert waveforms.shape == (12, 10)
    np.testing.assert_array_equal(waveforms.pixel, make_frame(3, **FULL).kept["waveforms"].pixel)


def test_crossings_of_a_timing_channel_come_back(tmp_path):
    frames = []
    for frame in make_frames(2, keep=("waveforms",)):
        waveforms = frame.kept["waveforms"]
        crossing_s = 1e-6 + 1e-9 * np.arange(len(waveforms.pixel))
        crossing_s[0] = np.nan  # a channel that never armed
        frames.append(with_kept(frame, waveforms=dataclasses.replace(waveforms, zero_crossing_s=crossing_s)))
    with export.open(export.save(tmp_path / "run.h5", frames)) as recording:
        for read, frame in zip(recording, frames, strict=True):
            given = frame.kept["waveforms"]
            np.testing.assert_array_equal(read.kept["waveforms"].zero_crossing_s, given.zero_crossing_s)


@pytest.mark.parametrize("suffix", [".h5", ".zarr"])
def test_clipped_samples_and_mean_currents_come_back(tmp_path, suffix):
    if suffix == ".zarr":
        pytest.importorskip("zarr", reason="needs the extra zarr: pip install 'rso-lidar[zarr]'")
    frames = []
    for frame in make_frames(2, keep=("waveforms",)):
        waveforms = frame.kept["waveforms"]
        more = {
            "clipped": waveforms.samples_counts > np.median(waveforms.samples_counts),
            "base_per_s": 1e8 + 1e6 * np.arange(len(waveforms.pixel)),
        }
        frames.append(with_kept(frame, waveforms=dataclasses.replace(waveforms, **more)))
    with export.open(export.save(tmp_path / f"run{suffix}", frames)) as recording:
        for read, frame in zip(recording, frames, strict=True):
            given, found = frame.kept["waveforms"], read.kept["waveforms"]
            assert found.clipped.dtype == bool and 0.0 < found.clipped.mean() < 1.0
            np.testing.assert_array_equal(found.clipped, given.clipped)
            np.testing.assert_array_equal(found.base_per_s, given.base_per_s)


def test_what_was_read_can_be_saved_again(tmp_path, saved):
    again = export.save(tmp_path / "again.h5", export.open(saved))
    for k, frame in enumerate(export.open(again)):
        assert_same(frame, make_frame(k, **FULL))


@pytest.mark.parametrize("how", [{"returns": True}, *({"keep": (name,)} for name in KEEP)])
def test_each_alone(tmp_path, how):
    with export.open(export.save(tmp_path / "run.h5", make_frames(2, **how))) as recording:
        assert_same(recording[1], make_frame(1, **how))
        assert tuple(recording[1].kept) == how.get("keep", ())


def test_nothing_is_there_that_was_not_asked_for(tmp_path):
    with export.open(export.save(tmp_path / "run.h5", make_frames(2))) as recording:
        for name in ("returns", *KEEP):
            assert name not in recording._file
            with pytest.raises(RecordingError, match=rf"run\.h5: has no {name}; ") as caught:
                getattr(recording, name)
            assert "\n" not in str(caught.value)
        assert not hasattr(recording.labels, "return_range_m")
        assert "return" not in recording._file["labels"]
        assert recording[0].kept == {}
        assert recording[0].labels.return_range_m is None
        assert recording[0].observation.reading.return_range_m is None


def test_photons_without_background(tmp_path):
    def bare(k):
        frame = make_frame(k, keep=("photons",))
        return with_kept(frame, photons=dataclasses.replace(frame.kept["photons"], background_photons_per_s=None))

    with export.open(export.save(tmp_path / "run.h5", map(bare, range(2)))) as recording:
        assert_same(recording[1], bare(1))
        assert recording[1].kept["photons"].background_photons_per_s is None
        assert set(vars(recording.photons)) == {"photons"}


def test_a_frame_without_a_trace(tmp_path):
    frame = make_frame(0, keep=("waveforms",))
    none = Waveforms((12, 10), 1.25e-9, 100.0, [], [], [], np.zeros((0, SAMPLES)))
    frames = [with_kept(frame, waveforms=none), make_frame(1, keep=("waveforms",))]
    with export.open(export.save(tmp_path / "run.h5", frames)) as recording:
        assert recording[0].kept["waveforms"].samples_counts.shape == (0, SAMPLES)
        for before, after in zip(frames, recording, strict=True):
            assert_same(before, after)


def test_waveforms_of_a_range_gate_have_no_latch(tmp_path):
    frame = make_frame(0, keep=("waveforms",))
    traces = frame.kept["waveforms"]
    gated = dataclasses.replace(traces, latch_s=np.full(len(traces.pixel), np.nan), start_s=np.zeros(len(traces.pixel)))
    frame = with_kept(frame, waveforms=gated)
    assert_same(export.open(export.save(tmp_path / "run.h5", [frame]))[0], frame)


def test_sunlight_of_each_body(recording):
    assert recording[2].truth.sunlit == make_frame(2, **FULL).truth.sunlit
    share = recording.dataset("truth/tdrs/sunlit")
    assert share.dtype == np.dtype("f8")
    assert "Sun" in share.attrs["long_name"]
    np.testing.assert_array_equal(share[:], [make_frame(k, **FULL).truth.sunlit["tdrs"] for k in range(5)])


# ---------------------------------------------------------------------------------------------------------- as arrays


def test_arrays_are_there_by_the_names_of_the_records(recording):
    frames = list(make_frames(5, **FULL))
    reading = [frame.observation.reading for frame in frames]
    np.testing.assert_array_equal(
        recording.returns.range_m[1:3], [reading[1].return_range_m, reading[2].return_range_m]
    )
    np.testing.assert_array_equal(recording.returns.intensity_counts[4], reading[4].return_intensity_counts)
    np.testing.assert_array_equal(recording.labels.return_range_m[4], frames[4].labels.return_range_m)
    np.testing.assert_array_equal(recording.labels.return_photons[4], frames[4].labels.return_photons)

    traces = frames[2].kept["waveforms"]
    held = recording.waveforms
    assert (held.sample_s, held.baseline_counts) == (1.25e-9, 100.0)
    assert held.samples_counts.shape == (5, 12, 10, SAMPLES)
    row, col = np.divmod(traces.pixel, 10)
    np.testing.assert_array_equal(held.samples_counts[2][row, col], traces.samples_counts)
    np.testing.assert_array_equal(held.start_s[2, row, col], traces.start_s)
    assert np.isfinite(held.latch_s[2]).sum() == np.isfinite(held.samples_counts[2]).all(axis=-1).sum() == len(row)

    photons = frames[2].kept["photons"]
    # float32 keeps 24 bits: 6e-8 of a pixel's photons
    np.testing.assert_allclose(recording.photons.photons[2].sum(dtype=float), photons.photons.sum(), rtol=1e-7)
    np.testing.assert_array_equal(
        recording.photons.background_photons_per_s[2], photons.background_photons_per_s.astype("f4")
    )
    np.testing.assert_array_equal(recording.oversampled.range_m[3], frames[3].kept["oversampled"].range_m)
    np.testing.assert_array_equal(recording.oversampled.photons[3], frames[3].kept["oversampled"].photons)
    for name in ("detection_probability", "range_sigma_m"):
        np.testing.assert_array_equal(
            getattr(recording.prediction, name)[3], getattr(frames[3].kept["prediction"], name)
        )


def test_plain_h5py_reads_the_layout(saved):
    wanted = {
        "returns/range": ("f4", "m", ("time", "row", "col", "returns/return")),
        "returns/intensity": ("u2", "count", ("time", "row", "col", "returns/return")),
        "labels/return_range_m": ("f8", "m", ("time", "row", "col", "labels/return")),
        "labels/return_photons": ("f4", "1", ("time", "row", "col", "labels/return")),
        "waveforms/samples": ("f4", "count", ("time", "row", "col", "waveforms/sample")),
        "waveforms/start": ("f8", "s", ("time", "row", "col")),
        "waveforms/latch": ("f8", "s", ("time", "row", "col")),
        "photons/image": ("f4", "1", ("time", "row", "col")),
        "photons/background": ("f4", "s-1", ("time", "row", "col")),
        "oversampled/range": ("f4", "m", ("time", "oversampled/fine_row", "oversampled/fine_col")),
        "oversampled/photons": ("f4", "1", ("time", "oversampled/fine_row", "oversampled/fine_col")),
        "prediction/detection_probability": ("f4", "1", ("time", "row", "col")),
        "prediction/range_sigma": ("f4", "m", ("time", "row", "col")),
    }
    with h5py.File(saved) as file:
        for path, (dtype, unit, dims) in wanted.items():
            dataset = file[path]
            assert dataset.dtype == np.dtype(dtype), path
            assert dataset.attrs["units"] == unit, path
            assert dataset.attrs["long_name"]
            assert [dim[0].name for dim in dataset.dims] == [f"/{dim}" for dim in dims], path
            assert dataset.chunks == (1, *dataset.shape[1:])
            assert (dataset.compression, dataset.shuffle) == ("gzip", True)
            assert dtype == "u2" or np.isnan(dataset.attrs["_FillValue"])
        assert file["returns/range"].shape[-1] == file["labels/return_photons"].shape[-1] == RETURNS
        assert file["oversampled/range"].shape == (5, 12 * FINER, 10 * FINER)
        assert file["waveforms"].attrs["sample_s"] == 1.25e-9
        assert file["waveforms"].attrs["baseline_counts"] == 100.0

        def described(name, item):
            if isinstance(item, h5py.Dataset):
                assert item.attrs["long_name"], name

        file.visititems(described)


def test_xarray_opens_it_unchanged(saved):
    import xarray

    frame = make_frame(3, **FULL)

    def group(name):
        return xarray.open_dataset(saved, engine="h5netcdf", group=name)

    with group("returns") as returns, group("labels") as labels:
        assert returns["range"].dims == labels["return_range_m"].dims == ("time", "row", "col", "return")
        np.testing.assert_array_equal(returns["range"].isel(time=3), frame.observation.reading.return_range_m)
    with group("oversampled") as oversampled, group("photons") as photons:
        assert oversampled["range"].dims == ("time", "fine_row", "fine_col")
        np.testing.assert_array_equal(oversampled["range"].isel(time=3), frame.kept["oversampled"].range_m)
        assert photons["background"].attrs["units"] == "s-1"
    with group("waveforms") as waveforms:
        assert waveforms["samples"].dims == ("time", "row", "col", "sample")
        assert waveforms.attrs["sample_s"] == 1.25e-9
        assert waveforms["latch"].dims == ("time", "row", "col")


# ------------------------------------------------------------------------------------------------------------ resume


def test_resume_goes_on_with_what_is_kept(tmp_path):
    how = {**FULL, "shape": (6, 5)}
    whole = export.save(tmp_path / "whole.h5", make_frames(5, **how))
    leave_unfinished(tmp_path / "run.h5", make_frames(3, **how), RUN)
    with export.open(tmp_path / f"run.h5.tmp-{RUN}") as recording:
        assert_same(recording[2], make_frame(2, **how))
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, resume=True) as recorder:
        for k in range(recorder.written, 5):
            recorder.write(make_frame(k, **how))
    assert datasets(tmp_path / "run.h5") == datasets(whole)


def test_resume_after_other_things_were_kept_is_refused(tmp_path):
    leave_unfinished(tmp_path / "run.h5", make_frames(2, keep=("photons",)), RUN)
    with (
        pytest.raises(RecordingError, match=r"photons/.* not in every frame"),
        export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, resume=True) as recorder,
    ):
        recorder.write(make_frame(2))


# ----------------------------------------------------------------------------------------------------------- refusals


def refused(tmp_path, *frames):
    with pytest.raises(RecordingError) as caught:
        export.save(tmp_path / "run.h5", frames)
    assert "\n" not in str(caught.value)
    for left in tmp_path.iterdir():
        left.unlink()
    return str(caught.value)


def test_what_has_no_fixed_shape_cannot_be_recorded(tmp_path):
    rays = Rays((12, 10), np.zeros((0, 3)), [], [])
    hits = Hits(rays, *[[]] * 9)
    for name, record in {"rays": rays, "hits": hits, "waveforms": hits}.items():
        line = refused(tmp_path, with_kept(make_frame(0), **{name: record}))
        assert f"kept {name}: cannot be recorded; keep waveforms, photons, oversampled, prediction, or" in line


def test_frames_that_keep_otherwise_than_the_first_are_refused(tmp_path):
    first = make_frame(0, keep=KEEP)
    traces = first.kept["waveforms"]
    assert "not in every frame" in refused(tmp_path, first, make_frame(1))
    assert "not in every frame" in refused(tmp_path, make_frame(0), make_frame(1, returns=True))
    finer = with_kept(first, waveforms=dataclasses.replace(traces, sample_s=1e-9))
    assert "frame 0: kept waveforms are sampled otherwise than the first's" in refused(tmp_path, first, finer)
    longer = dataclasses.replace(traces, samples_counts=np.zeros((len(traces.pixel), SAMPLES + 1)))
    line = refused(tmp_path, first, with_kept(first, waveforms=longer))
    assert "waveforms/samples: needs the shape (12, 10, 20), not (12, 10, 21)" in line
    many = dataclasses.replace(first.kept["oversampled"], range_m=np.zeros((3, 3)), photons=np.zeros((3, 3)))
    assert "oversampled/range: needs the shape" in refused(tmp_path, first, with_kept(first, oversampled=many))


def test_waveforms_that_do_not_fit_the_frame_are_refused(tmp_path):
    frame = make_frame(0, keep=("waveforms",))
    traces = frame.kept["waveforms"]
    other = dataclasses.replace(traces, shape=(24, 20))
    assert "kept waveforms: are of (24, 20) pixels, the frame of (12, 10)" in refused(
        tmp_path, with_kept(frame, waveforms=other)
    )
    never = dataclasses.replace(traces, start_s=np.full(len(traces.pixel), np.nan))
    assert "start_s is not finite" in refused(tmp_path, with_kept(frame, waveforms=never))
    short = dataclasses.replace(traces, samples_counts=np.zeros((len(traces.pixel), 0)))
    assert "record at least one of each" in refused(tmp_path, with_kept(frame, waveforms=short))


def test_a_dataset_that_is_missing_is_named(tmp_path, saved):
    whole = saved.read_bytes()
    for path in (
        "returns/range",
        "labels/return_photons",
        "truth/tdrs/sunlit",
        "waveforms/start",
        "photons",
        "oversampled",
    ):
        (tmp_path / "run.h5").write_bytes(whole)
        with h5py.File(tmp_path / "run.h5", "a") as file:
            del file[path]
        with pytest.raises(RecordingError, match=rf"the dataset(s? {path}\S*,?)+ (is|are) missing"):
            export.open(tmp_path / "run.h5")
    (tmp_path / "run.h5").write_bytes(whole)
    with h5py.File(tmp_path / "run.h5", "a") as file:
        del file["waveforms"].attrs["sample_s"]
    with pytest.raises(RecordingError, match="is damaged"):
        export.open(tmp_path / "run.h5")


def test_a_recording_from_before_has_none_of_it(tmp_path):
    path = export.save(tmp_path / "run.h5", make_frames(2))
    with h5py.File(path, "a") as file:
        del file.attrs["optional_datasets"]
    with export.open(path) as recording:
        assert recording[1].truth.sunlit == {}
        assert recording[1].kept == {}


# -------------------------------------------------------------------------------------------------------------- sizes


def test_sky_costs_next_to_nothing(tmp_path):
    """128 x 128 pixels of which 1 % are lit: kept records cost about what their traces do, not what the array does."""
    how = {"shape": (128, 128), "lit": 0.01}
    sizes = {
        keep: export.save(tmp_path / f"run{len(keep)}.h5", make_frames(6, keep=keep, **how)).stat().st_size
        for keep in ((), ("waveforms",))
    }
    each = (sizes["waveforms",] - sizes[()]) / 6
    count = len(make_frame(0, keep=("waveforms",), **how).kept["waveforms"].pixel)
    assert count == 169
    # 12-bit samples in float32, start and latch in float64; gzip's longest match is 258 bytes, so sky shrinks 500-fold
    traces, sky = count * (4 * SAMPLES + 2 * 8), 128 * 128 * (4 * SAMPLES + 2 * 8)
    assert each < traces + sky / 200


def test_photons_are_summed_by_pixel():
    photons = Photons(
        shape=(2, 3),
        pulse_fwhm_s=8e-9,
        pulse_step_s=1e-9,
        late_s=0.0,
        pulse_power_per_s=np.array([1e9]),
        pixel=[0, 4, 4, 5],
        delay_s=np.zeros(4),
        photons=[1.0, 2.0, 3.0, 4.0],
        depth_spread_s=np.zeros(4),
        coherence_cells=np.ones(4),
        hit=np.arange(4),
        cluster=np.arange(4),
        cluster_pixel=[0, 4, 4, 5],
    )
    found = intermediates.collect_arrays({"photons": photons}, (2, 3))
    assert found["photons/image"].tolist() == [[1, 0, 0], [0, 5, 4]]
    assert found.keys() == {"photons/image"}


def test_info_says_what_is_held(tmp_path, capsys):
    from rso_lidar.cli.info import info

    path = export.save(tmp_path / "run.h5", make_frames(3, **FULL, zoom=lambda k: 1.0 + k))
    info(path)
    said = capsys.readouterr().out
    for line in (
        "lens        3 tables of lines",
        "returns     up to 3",
        "kept        waveforms, photons, oversampled, prediction\n",
    ):
        assert line in said
    assert "follower 100%\n" in said
    info(export.save(tmp_path / "plain.h5", make_frames(1)))
    said = capsys.readouterr().out
    assert "kept" not in said
    assert "lens  " not in said
