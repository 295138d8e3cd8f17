"""Constants of the shipped detectors, as `make calibrate` solved them through the whole chain."""

import tomllib
from pathlib import Path
from typing import Any

DETECTOR_PRESETS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("presets.toml").read_text(encoding="utf-8")
)
DEFAULT = DETECTOR_PRESETS["noise_limited"]
FITTED = DETECTOR_PRESETS["empirical"]
# What a preset of the full chain sets: part and key, and what it is called.
SOLVED_CONSTANTS = {
    ("amplifier", "noise_electrons"): "amplifier noise",
    ("trigger", "threshold_electrons"): "threshold",
}
