"""What the lidar will get of a mission: link budgets, passes, time histories, parameters and models."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.mission_analysis.budgets.finding_range import (
        FoundRange,
        find_range,
    )
    from rso_lidar.mission_analysis.budgets.navigation_lidar import (
        find_navigation_lidar,
    )
    from rso_lidar.mission_analysis.budgets.range_budget import (
        Budget,
        budget,
    )
    from rso_lidar.mission_analysis.budgets.range_curve import (
        BudgetCurve,
    )
    from rso_lidar.mission_analysis.camera.data_sheet import (
        CameraDataSheet,
        data_sheet,
    )
    from rso_lidar.mission_analysis.intervals.event_scenario import (
        event_scenario_text,
    )
    from rso_lidar.mission_analysis.intervals.event_table import (
        Event,
        Events,
    )
    from rso_lidar.mission_analysis.intervals.interval_search import (
        events,
    )
    from rso_lidar.mission_analysis.mission_parameters.parameter_list import (
        MissionParameter,
        split_unit,
    )
    from rso_lidar.mission_analysis.mission_parameters.parameter_table import (
        ParameterTable,
        list_parameters,
    )
    from rso_lidar.mission_analysis.mission_parameters.sysml_text import (
        SYSML_MISSION,
        declare_attribute,
        quote_name,
        write_comment,
    )
    from rso_lidar.mission_analysis.models.material_list import (
        list_materials,
    )
    from rso_lidar.mission_analysis.models.model_card import (
        ModelCard,
        make_model_card,
    )
    from rso_lidar.mission_analysis.passes.conjunction_assessment import (
        ConjunctionAssessment,
        assess_conjunction,
    )
    from rso_lidar.mission_analysis.passes.conjunction_scenario import (
        conjunction_scenario_text,
    )
    from rso_lidar.mission_analysis.passes.covariance_sources import (
        SetErrorTable,
    )
    from rso_lidar.mission_analysis.passes.pass_collision import (
        PassCollision,
    )
    from rso_lidar.mission_analysis.passes.pass_geometry import (
        Encounter,
        reach_m,
    )
    from rso_lidar.mission_analysis.passes.pass_table import (
        Encounters,
    )
    from rso_lidar.mission_analysis.passes.plate_light import (
        ViewedPlate,
    )
    from rso_lidar.mission_analysis.passes.scenario_text import (
        scenario_text,
    )
    from rso_lidar.mission_analysis.passes.search import (
        encounters,
    )
    from rso_lidar.mission_analysis.passes.search_objects import (
        BodyTrajectory,
    )
    from rso_lidar.mission_analysis.passes.set_errors import (
        SetErrors,
        estimate_set_errors,
    )
    from rso_lidar.mission_analysis.time_history.czml import (
        choose_globe_samples,
        write_globe,
    )
    from rso_lidar.mission_analysis.time_history.open_loop import (
        find_velocity_jumps_s,
        fly_open_loop,
    )
    from rso_lidar.mission_analysis.time_history.pixel_summary import (
        PixelReport,
        report_pixel,
    )
    from rso_lidar.mission_analysis.time_history.timeline import (
        Timeline,
        in_field_fraction,
        timeline,
    )
    from rso_lidar.mission_analysis.time_history.truth_at_epochs import (
        truth,
    )
    from rso_lidar.mission_analysis.time_history.truth_files import (
        TRUTH_FIGURES,
        check_truth_output,
        draw_trajectory,
        save_truth,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "SYSML_MISSION",
    "TRUTH_FIGURES",
    "BodyTrajectory",
    "Budget",
    "BudgetCurve",
    "CameraDataSheet",
    "ConjunctionAssessment",
    "Encounter",
    "Encounters",
    "Event",
    "Events",
    "FoundRange",
    "MissionParameter",
    "ModelCard",
    "ParameterTable",
    "PassCollision",
    "PixelReport",
    "SetErrorTable",
    "SetErrors",
    "Timeline",
    "ViewedPlate",
    "assess_conjunction",
    "budget",
    "check_truth_output",
    "choose_globe_samples",
    "conjunction_scenario_text",
    "data_sheet",
    "declare_attribute",
    "draw_trajectory",
    "encounters",
    "estimate_set_errors",
    "event_scenario_text",
    "events",
    "find_navigation_lidar",
    "find_range",
    "find_velocity_jumps_s",
    "fly_open_loop",
    "in_field_fraction",
    "list_materials",
    "list_parameters",
    "make_model_card",
    "quote_name",
    "reach_m",
    "report_pixel",
    "save_truth",
    "scenario_text",
    "split_unit",
    "timeline",
    "truth",
    "write_comment",
    "write_globe",
]

__dir__ = limit_dir(__name__)
