"""`rso-lidar schema`: the JSON Schema of a scenario, for editors."""

import json

from rso_lidar.cli.terminal import echo
from rso_lidar.scenario import Scenario


def schema() -> None:
    """Print the JSON Schema of the scenario file. Editors use it to complete and check TOML."""
    echo(json.dumps(Scenario.model_json_schema(), indent=2))
