"""Constants of the shipped detectors, as `make calibrate` solved them through the whole chain."""

import tomllib
from pathlib import Path
from typing import Any

DETECTOR_PRESETS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("presets.toml").read_text(encoding="utf-8")
)
DEFAULT = DETECTOR_PRESETS["noise_limited"]
FITTED = DETECTOR_PRESETS["empirical"]
