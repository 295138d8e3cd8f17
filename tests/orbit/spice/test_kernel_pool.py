"""Without the extra `spice`, a line names it."""

import datetime
import importlib.util

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, SpiceMotion, read_spice_attitude

EPOCHS = Epochs(datetime.datetime(2024, 9, 17, tzinfo=datetime.UTC), np.zeros(1))


def test_the_extra_is_named_where_it_is_not_installed(monkeypatch):
    known = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "spiceypy" else known(name))
    line = r"spice -5: SPICE kernels need the extra 'spice' \(pip install 'rso-lidar\[spice\]'\)"
    with pytest.raises(ScenarioError, match=line):
        SpiceMotion(kernels=("none.bsp",), body="-5").states(EPOCHS)
    with pytest.raises(ScenarioError, match="spice A: SPICE kernels need the extra 'spice'"):
        read_spice_attitude(["none.bc"], "A", EPOCHS)
