"""What the lidar will get of a mission: link budgets, passes, time histories, parameters and models."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.mission_analysis.budgets.finding_range import FoundRange, find_range
    from rso_lidar.mission_analysis.budgets.navigation_lidar import find_navigation_lidar
    from rso_lidar.mission_analysis.budgets.range_budget import Budget, budget
    from rso_lidar.mission_analysis.budgets.range_curve import BudgetCurve
    from rso_lidar.mission_analysis.mission_parameters.parameter_list import MissionParameter
    from rso_lidar.mission_analysis.mission_parameters.parameter_table import ParameterTable, list_parameters
    from rso_lidar.mission_analysis.passes.conjunction_assessment import ConjunctionAssessment, assess_conjunction
    from rso_lidar.mission_analysis.passes.conjunction_scenario import conjunction_scenario_text
    from rso_lidar.mission_analysis.passes.pass_geometry import Encounter, reach_m
    from rso_lidar.mission_analysis.passes.pass_table import Encounters
    from rso_lidar.mission_analysis.passes.plate_light import ViewedPlate
    from rso_lidar.mission_analysis.passes.scenario_text import scenario_text
    from rso_lidar.mission_analysis.passes.search import encounters
    from rso_lidar.mission_analysis.passes.set_errors import SetErrors, estimate_set_errors
    from rso_lidar.mission_analysis.time_history.pixel_summary import PixelReport, report_pixel
    from rso_lidar.mission_analysis.time_history.timeline import Timeline, timeline
    from rso_lidar.mission_analysis.time_history.truth_at_epochs import truth

__all__ = [
    "Budget",
    "BudgetCurve",
    "ConjunctionAssessment",
    "Encounter",
    "Encounters",
    "FoundRange",
    "MissionParameter",
    "ParameterTable",
    "PixelReport",
    "SetErrors",
    "Timeline",
    "ViewedPlate",
    "assess_conjunction",
    "budget",
    "conjunction_scenario_text",
    "encounters",
    "estimate_set_errors",
    "find_navigation_lidar",
    "find_range",
    "list_parameters",
    "reach_m",
    "report_pixel",
    "scenario_text",
    "timeline",
    "truth",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
