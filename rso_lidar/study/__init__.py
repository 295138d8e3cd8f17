"""Studies of scenarios and recordings: link budgets, encounters, timelines, trades, tracking, maps and requirements."""

from rso_lidar.public_names import limit_dir
from rso_lidar.study.budgets.finding_range import FoundRange, find_range
from rso_lidar.study.budgets.navigation_lidar import find_navigation_lidar
from rso_lidar.study.budgets.range_budget import Budget, budget
from rso_lidar.study.budgets.range_curve import BudgetCurve
from rso_lidar.study.dispersions.dispersed_mission import DispersedMission, disperse
from rso_lidar.study.elevation import (
    HAZARD,
    SAFE,
    UNKNOWN,
    ElevationMap,
    MapAgreement,
    build_elevation_map,
    build_true_elevation,
    compare_maps,
    find_hazards,
)
from rso_lidar.study.mission_parameters.parameter_list import MissionParameter
from rso_lidar.study.mission_parameters.parameter_table import ParameterTable, list_parameters
from rso_lidar.study.orbit_determination.recorded_fits import (
    RelativeNavigation,
    find_true_relative_state,
    fit_own_orbit,
    fit_relative_orbit,
)
from rso_lidar.study.passes.conjunction_assessment import ConjunctionAssessment, assess_conjunction
from rso_lidar.study.passes.conjunction_scenario import conjunction_scenario_text
from rso_lidar.study.passes.pass_geometry import Encounter, reach_m
from rso_lidar.study.passes.pass_table import Encounters
from rso_lidar.study.passes.plate_light import ViewedPlate
from rso_lidar.study.passes.scenario_text import scenario_text
from rso_lidar.study.passes.search import encounters
from rso_lidar.study.passes.set_errors import SetErrors, estimate_set_errors
from rso_lidar.study.previews.pixel_summary import PixelReport, report_pixel
from rso_lidar.study.recorded_runs.conversion import save
from rso_lidar.study.recorded_runs.display import view
from rso_lidar.study.recorded_runs.frame_comparison import FrameDifference, compare_frames
from rso_lidar.study.time_history.timeline import Timeline, timeline
from rso_lidar.study.time_history.truth_at_epochs import truth
from rso_lidar.study.track_quality.evaluation import Tracking, tracking
from rso_lidar.study.track_quality.target_mesh import sample_target
from rso_lidar.study.trades.definition import Study
from rso_lidar.study.trades.execution import Trade, trade
from rso_lidar.study.verification.matrix import RequirementResult, VerificationMatrix
from rso_lidar.study.verification.requirements_file import Requirement, Requirements
from rso_lidar.study.verification.verify import verify

__all__ = [
    "HAZARD",
    "SAFE",
    "UNKNOWN",
    "Budget",
    "BudgetCurve",
    "ConjunctionAssessment",
    "DispersedMission",
    "ElevationMap",
    "Encounter",
    "Encounters",
    "FoundRange",
    "FrameDifference",
    "MapAgreement",
    "MissionParameter",
    "ParameterTable",
    "PixelReport",
    "RelativeNavigation",
    "Requirement",
    "RequirementResult",
    "Requirements",
    "SetErrors",
    "Study",
    "Timeline",
    "Tracking",
    "Trade",
    "VerificationMatrix",
    "ViewedPlate",
    "assess_conjunction",
    "budget",
    "build_elevation_map",
    "build_true_elevation",
    "compare_frames",
    "compare_maps",
    "conjunction_scenario_text",
    "disperse",
    "encounters",
    "estimate_set_errors",
    "find_hazards",
    "find_navigation_lidar",
    "find_range",
    "find_true_relative_state",
    "fit_own_orbit",
    "fit_relative_orbit",
    "list_parameters",
    "reach_m",
    "report_pixel",
    "sample_target",
    "save",
    "scenario_text",
    "timeline",
    "tracking",
    "trade",
    "truth",
    "verify",
    "view",
]

__dir__ = limit_dir(__name__)
