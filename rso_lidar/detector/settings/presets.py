"""Constants of the shipped detectors, as `make calibrate` solved them through the whole chain."""

import tomllib
from pathlib import Path
from typing import Any

PRESETS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))
DEFAULT = PRESETS["noise_limited"]
FITTED = PRESETS["empirical"]
