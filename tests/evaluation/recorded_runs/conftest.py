import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def handmade():
    """The module of frames made by hand: make_frame, make_truth, approach."""
    place = Path(__file__).parents[2] / "picture" / "frames_for_tests.py"
    spec = importlib.util.spec_from_file_location("frames_for_tests", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def coming(handmade):
    """Twelve small frames of an approach from 3 km to 300 m."""
    return handmade.approach(12, n=64, photons_at_km=60_000.0)
