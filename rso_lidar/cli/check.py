"""`rso-lidar check`: checks and summary of a scenario."""

from rso_lidar.cli.arguments import ScenarioFile, Settings, TrustCode, TrustFmu
from rso_lidar.cli.progress import announce_compiling
from rso_lidar.cli.terminal import echo
from rso_lidar.scenario import Scenario


def check(
    file: ScenarioFile, settings: Settings = None, trust_code: TrustCode = False, trust_fmu: TrustFmu = False
) -> None:
    """Check a scenario and print a summary. The summary covers orbit, geometry, optics, link budget and warnings."""
    scenario = Scenario.load(file, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    with announce_compiling():
        described = scenario.describe()
    echo(described)
