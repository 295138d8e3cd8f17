"""Studies of scenarios and recordings: link budgets, encounters, timelines, trades, targeters, tracking and requirements."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.evaluation import (
        HAZARD,
        SAFE,
        UNKNOWN,
        ElevationMap,
        FrameDifference,
        MapAgreement,
        MeasuredWander,
        RelativeNavigation,
        Tracking,
        build_elevation_map,
        build_true_elevation,
        compare_frames,
        compare_maps,
        find_hazards,
        find_true_relative_state,
        fit_own_orbit,
        fit_relative_orbit,
        fit_tracking_data,
        measure_centroid_wander,
        sample_target,
        save,
        save_tracking_data,
        tracking,
        view,
    )
    from rso_lidar.mission_analysis import (
        BodyTrajectory,
        Budget,
        BudgetCurve,
        CameraDataSheet,
        ConjunctionAssessment,
        Encounter,
        Encounters,
        Event,
        Events,
        FoundRange,
        MissionParameter,
        ParameterTable,
        PassCollision,
        PixelReport,
        SetErrors,
        SetErrorTable,
        Timeline,
        ViewedPlate,
        assess_conjunction,
        budget,
        conjunction_scenario_text,
        data_sheet,
        encounters,
        estimate_set_errors,
        event_scenario_text,
        events,
        find_navigation_lidar,
        find_range,
        list_parameters,
        reach_m,
        report_pixel,
        save_truth,
        scenario_text,
        timeline,
        truth,
    )
    from rso_lidar.study.dispersions.dispersed_mission import (
        DispersedMission,
        disperse,
    )
    from rso_lidar.study.targeting.solved_plan import (
        SolvedPlan,
        solve_targeter,
    )
    from rso_lidar.study.targeting.targeter_file import (
        Targeter,
    )
    from rso_lidar.study.trades.definition import (
        Study,
    )
    from rso_lidar.study.trades.execution import (
        Trade,
        TradeRun,
        trade,
    )
    from rso_lidar.study.verification.matrix import (
        RequirementResult,
        VerificationMatrix,
    )
    from rso_lidar.study.verification.requirements_file import (
        Requirement,
        Requirements,
    )
    from rso_lidar.study.verification.sysml_requirements import (
        write_requirements,
    )
    from rso_lidar.study.verification.verify import (
        verify,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "HAZARD",
    "SAFE",
    "UNKNOWN",
    "BodyTrajectory",
    "Budget",
    "BudgetCurve",
    "CameraDataSheet",
    "ConjunctionAssessment",
    "DispersedMission",
    "ElevationMap",
    "Encounter",
    "Encounters",
    "Event",
    "Events",
    "FoundRange",
    "FrameDifference",
    "MapAgreement",
    "MeasuredWander",
    "MissionParameter",
    "ParameterTable",
    "PassCollision",
    "PixelReport",
    "RelativeNavigation",
    "Requirement",
    "RequirementResult",
    "Requirements",
    "SetErrorTable",
    "SetErrors",
    "SolvedPlan",
    "Study",
    "Targeter",
    "Timeline",
    "Tracking",
    "Trade",
    "TradeRun",
    "VerificationMatrix",
    "ViewedPlate",
    "assess_conjunction",
    "budget",
    "build_elevation_map",
    "build_true_elevation",
    "compare_frames",
    "compare_maps",
    "conjunction_scenario_text",
    "data_sheet",
    "disperse",
    "encounters",
    "estimate_set_errors",
    "event_scenario_text",
    "events",
    "find_hazards",
    "find_navigation_lidar",
    "find_range",
    "find_true_relative_state",
    "fit_own_orbit",
    "fit_relative_orbit",
    "fit_tracking_data",
    "list_parameters",
    "measure_centroid_wander",
    "reach_m",
    "report_pixel",
    "sample_target",
    "save",
    "save_tracking_data",
    "save_truth",
    "scenario_text",
    "solve_targeter",
    "timeline",
    "tracking",
    "trade",
    "truth",
    "verify",
    "view",
    "write_requirements",
]

__dir__ = limit_dir(__name__)
