"""What a user describes, joined: Time, World, Target, Follower, Lidar, Scenario."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.scenario.examples import (
        SHORTEST_EXAMPLE,
        Example,
        find_examples,
        iterate_texts,
    )
    from rso_lidar.scenario.mission.moon_missions import (
        list_lunar_bodies,
    )
    from rso_lidar.scenario.mission.named_files import (
        iterate_named_files,
        list_dynamics,
        list_named_code,
        list_named_files,
    )
    from rso_lidar.scenario.mission.surface_forces import (
        facet_forces,
    )
    from rso_lidar.scenario.mission.target_surfaces import (
        build_whole_surface,
        find_part_classes,
        find_symmetry,
        find_taxonomy,
        name_part_materials,
    )
    from rso_lidar.scenario.mission.validation import (
        FilePart,
        apply_setting,
        get_field,
        read_toml,
        set_field,
        validate_tables,
        validate_toml,
    )
    from rso_lidar.scenario.preview.geometry import (
        is_in_field,
        place_hull,
        preview_mission,
    )
    from rso_lidar.scenario.preview.returns import (
        cast_surfaces,
    )
    from rso_lidar.scenario.preview.whole_target import (
        find_aspects,
        find_probability,
        list_run_attitudes,
        move_target,
        open_aspects,
        spread_attitudes,
    )
    from rso_lidar.scenario.scenario import (
        Scenario,
        find_target,
        require_scenario,
    )
    from rso_lidar.scenario.tables.calibration import (
        AssumedSetting,
        CalibratedConstant,
        Calibration,
        CalibrationData,
    )
    from rso_lidar.scenario.tables.constraints import (
        Constraints,
        Corridor,
    )
    from rso_lidar.scenario.tables.dispersion import (
        CovarianceErrors,
        Dispersion,
        ElementSetErrors,
        StateErrors,
        TargetErrors,
    )
    from rso_lidar.scenario.tables.facet_materials import (
        FacetMaterials,
    )
    from rso_lidar.scenario.tables.facet_parts import (
        FacetParts,
    )
    from rso_lidar.scenario.tables.finding import (
        Finding,
    )
    from rso_lidar.scenario.tables.fragment import (
        Fragment,
        build_fragment,
        name_fragments,
    )
    from rso_lidar.scenario.tables.joints import (
        Joint,
    )
    from rso_lidar.scenario.tables.lidar import (
        Lidar,
    )
    from rso_lidar.scenario.tables.link import (
        DataLink,
    )
    from rso_lidar.scenario.tables.presets import (
        load_presets,
    )
    from rso_lidar.scenario.tables.schedule import (
        Schedule,
    )
    from rso_lidar.scenario.tables.target import (
        Follower,
        Target,
    )
    from rso_lidar.scenario.tables.terrain import (
        CratersAndBoulders,
        HeightField,
    )
    from rso_lidar.scenario.tables.world import (
        Time,
        World,
        parse_frames,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "SHORTEST_EXAMPLE",
    "AssumedSetting",
    "CalibratedConstant",
    "Calibration",
    "CalibrationData",
    "Constraints",
    "Corridor",
    "CovarianceErrors",
    "CratersAndBoulders",
    "DataLink",
    "Dispersion",
    "ElementSetErrors",
    "Example",
    "FacetMaterials",
    "FacetParts",
    "FilePart",
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
    "apply_setting",
    "build_fragment",
    "build_whole_surface",
    "cast_surfaces",
    "facet_forces",
    "find_aspects",
    "find_examples",
    "find_part_classes",
    "find_probability",
    "find_symmetry",
    "find_target",
    "find_taxonomy",
    "get_field",
    "is_in_field",
    "iterate_named_files",
    "iterate_texts",
    "list_dynamics",
    "list_lunar_bodies",
    "list_named_code",
    "list_named_files",
    "list_run_attitudes",
    "load_presets",
    "move_target",
    "name_fragments",
    "name_part_materials",
    "open_aspects",
    "parse_frames",
    "place_hull",
    "preview_mission",
    "read_toml",
    "require_scenario",
    "set_field",
    "spread_attitudes",
    "validate_tables",
    "validate_toml",
]

__dir__ = limit_dir(__name__)
