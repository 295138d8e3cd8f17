"""What a user describes, joined: Time, World, Target, Follower, Lidar, Scenario."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.scenario.scenario import Scenario, require_scenario
    from rso_lidar.scenario.tables.constraints import Constraints, Corridor
    from rso_lidar.scenario.tables.dispersion import Dispersion, ElementSetErrors, StateErrors, TargetErrors
    from rso_lidar.scenario.tables.facet_materials import FacetMaterials
    from rso_lidar.scenario.tables.finding import Finding
    from rso_lidar.scenario.tables.fragment import Fragment
    from rso_lidar.scenario.tables.joints import Joint
    from rso_lidar.scenario.tables.lidar import Lidar
    from rso_lidar.scenario.tables.link import DataLink
    from rso_lidar.scenario.tables.schedule import Schedule
    from rso_lidar.scenario.tables.target import Follower, Target
    from rso_lidar.scenario.tables.terrain import CratersAndBoulders, HeightField
    from rso_lidar.scenario.tables.world import Time, World

__all__ = [
    "Constraints",
    "Corridor",
    "CratersAndBoulders",
    "DataLink",
    "Dispersion",
    "ElementSetErrors",
    "FacetMaterials",
    "Finding",
    "Follower",
    "Fragment",
    "HeightField",
    "Joint",
    "Lidar",
    "Scenario",
    "Schedule",
    "StateErrors",
    "Target",
    "TargetErrors",
    "Time",
    "World",
    "require_scenario",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
