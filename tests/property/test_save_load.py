"""Save, then load, is the identity."""

import sys
import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1] / "export"))
from frames_for_tests import assert_same, make_frame

from rso_lidar import export


@settings(max_examples=6, deadline=None)  # each writes up to 4 frames and reads as many
@given(
    seed=st.integers(0, 2**32),
    count=st.integers(1, 2),
    shape=st.tuples(st.integers(1, 17), st.integers(1, 17)),
    ptu=st.booleans(),
    lit=st.floats(0, 1),
    names=st.dictionaries(
        st.from_regex(r"[a-z]{1,8}_(m|rad|s|counts)", fullmatch=True), st.floats(allow_nan=False), max_size=4
    ),
)
def test_save_then_load_is_the_identity(seed, count, shape, ptu, lit, names):
    frames = [make_frame(k, seed, shape, ptu=ptu, lit=lit, settings=names) for k in range(count)]
    with tempfile.TemporaryDirectory() as folder:
        path = export.save(Path(folder) / "run.h5", iter(frames))
        with export.open(path) as recording:
            assert len(recording) == count
            for before, after in zip(frames, recording, strict=True):
                assert_same(before, after)
        again = export.save(Path(folder) / "again.h5", export.open(path))
        with export.open(again) as recording:
            for before, after in zip(frames, recording, strict=True):
                assert_same(before, after)
