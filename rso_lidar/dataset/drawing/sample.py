"""One sample of a dataset: its drawn values, and the scenario that they make."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rso_lidar.dataset.drawing.inputs import name_kinds, name_model
from rso_lidar.dataset.drawing.plan import DatasetPlan, find_shapes
from rso_lidar.dataset.drawing.uniform_numbers import HaltonPoints, draw_seed, draw_shares
from rso_lidar.dataset.specification.distributions import Choice, UniformDirection, UniformRotation
from rso_lidar.dataset.specification.spec import DatasetSpec
from rso_lidar.dataset.specification.tables import ClassOfTargets, DrawnFragments, RandomView
from rso_lidar.errors import DatasetError, add_place
from rso_lidar.motion import lidar_from_ptu
from rso_lidar.scenario import Lidar, Scenario, apply_setting, get_field, name_fragments, set_field, validate_tables

_OF_ANY_MODEL = ("name", "motion", "attitude", "material", "axes")  # fields of a target that another model keeps
_AROUND = UniformDirection()
_LAST_SHARE = 1.0 - 2.0**-53  # greatest random number that can be drawn
_MOST_CHOICES = 100  # values of a law `choice` that a check tries, at most: each builds a scenario
_halton = lru_cache(maxsize=256)(HaltonPoints)  # one sequence for each class


@dataclass(frozen=True, eq=False)
class Sample:
    """One drawn sample: its class, model, sensor and split, its drawn values, its scenario, its frames and noise seeds."""

    index: int
    class_id: int  # among the classes with targets; -1 without a target
    model: str | None
    sensor_id: int
    split: str
    values: dict[str, Any]  # drawn values by variable
    frames: tuple[int, ...]
    seeds: tuple[int, ...]  # of each noise draw
    scenario: Scenario
    target: int | None  # index of the target in the scenario


class _Draws:
    """The values of one sample's variables, by their laws."""

    def __init__(self, spec: DatasetSpec, k: int, number: int, forced: Mapping[str, float]) -> None:
        """Begin the draws of a sample; `forced` are numbers from 0 to below 1 by variable, in place of drawn ones."""
        self._forced = forced
        self._spec, self._group, self._number = spec, spec.classes[k].name, number
        self.values: dict[str, Any] = {}
        self._left = np.zeros(0)
        if spec.sampling == "halton" and (dimensions := sum(law.dimensions for law in _list_laws(spec, k))):
            self._left = _halton(spec.seed, self._group, dimensions).at(number)

    def draw(self, variable: str, law: Any) -> Any:
        """Draw the value of a variable, and store it in `values`."""
        if self._spec.sampling == "halton" and not variable.startswith("clutter."):
            share, self._left = self._left[: law.dimensions], self._left[law.dimensions :]
        else:
            share = draw_shares(self._spec.seed, self._group, np.array([self._number]), variable, law.dimensions)[0]
        if variable in self._forced:
            share = np.full(law.dimensions, self._forced[variable])
        self.values[variable] = value = law.at(share)
        return value


def _list_laws(spec: DatasetSpec, k: int) -> list[Any]:
    """List the laws that apply to a class, in the order in which they are drawn."""
    laws: list[Any] = []
    if (fragments := spec.classes[k].fragments) is not None:
        laws += [fragments.characteristic_length_m, fragments.seed]
    laws += [variable.law for variable in spec.variables_of(spec.classes[k])]
    if (view := spec.view) is not None and not spec.classes[k].empty:
        laws += [view.range_m, view.offset_fraction, view.attitude]
        laws += [] if view.spin_deg_s is None else [view.spin_deg_s, _AROUND]
    if view is not None and view.sun is not None:
        laws.append(view.sun)
    return laws


def list_ends(spec: DatasetSpec, k: int) -> list[dict[str, float]]:
    """List arguments `forced` of `draw_sample` that reach both ends of each variable of a class, and each choice."""
    ends = []
    for variable in spec.variables_of(spec.classes[k]):
        count = len(variable.law.values) if isinstance(variable.law, Choice) and not variable.law.weights else 1
        places = [(place + 0.5) / count for place in range(min(count, _MOST_CHOICES))] if count > 1 else []
        ends += [{variable.field: share} for share in (0.0, *places, _LAST_SHARE)]
    return ends


def draw_sample(plan: DatasetPlan, index: int, forced: Mapping[str, float] = MappingProxyType({})) -> Sample:
    """Draw one sample, which depends on the plan and on its number only.

    Parameters
    ----------
    forced : numbers from 0 to below 1 by variable, in place of those that are drawn; for checks

    Raises
    ------
    DatasetError, ScenarioError
        If the drawn values do not make a valid scenario.
    """
    spec = plan.spec
    k, number, split = plan.place_sample(index)
    target_class = spec.classes[k]
    at = np.array([number])
    name = None if target_class.empty else plan.class_models[k][int(plan.choose_model(k, at)[0])]
    sensor = int(plan.choose_sensor(k, at)[0])
    draws = _Draws(spec, k, number, forced)
    with add_place(f"{spec.where}: sample {index} (class '{target_class.name}')"):
        tables = plan.copy_tables(sensor)
        _choose_target(tables, plan, name, target_class, draws)
        for setting in target_class.set:  # of the model that was chosen
            apply_setting(tables, setting)
        applied = spec.variables_of(target_class)
        for drawn in applied:
            if drawn.field in draws.values:
                raise DatasetError(
                    f"variable {drawn.field}: is drawn twice; remove one of the two, or give each its classes"
                )
            set_field(tables, drawn.field, draws.draw(drawn.field, drawn.law), f"variable {drawn.field}")
        if spec.view is not None:
            _place_view(tables, plan, spec.view, draws, has_target=name is not None)
        seeds = tuple(draw_seed(spec.seed, target_class.name, number, draw) for draw in range(spec.draws))
        tables["seed"] = seeds[0]
        for drawn in applied:
            if get_field(tables, drawn.field, f"variable {drawn.field}") is not draws.values[drawn.field]:
                raise DatasetError(
                    f"variable {drawn.field}: is overwritten by the view, the noise or another variable; remove one of them"
                )
        scenario = plan.build(tables)
        _check_shape(scenario, plan)
        if name is not None and (model := name_model(scenario.target[plan.target_index])) != name:
            raise DatasetError(f"a variable or setting makes the target '{model}', not '{name}'; name it in models")
        frames = _choose_frames(spec, scenario, draw_shares(spec.seed, target_class.name, at, "start")[0, 0])
    class_id = -1 if target_class.empty else plan.classes.index(target_class.name)
    target = None if target_class.empty else plan.target_index
    return Sample(index, class_id, name, sensor, split, draws.values, frames, seeds, scenario, target)


def _check_shape(scenario: Scenario, plan: DatasetPlan) -> None:
    """Raise `DatasetError` for images of another size than those of the first sensor, or of other cameras."""
    shapes, wanted = find_shapes(scenario), plan.image_shapes
    if unlike := sorted(shapes.keys() ^ wanted.keys()):
        raise DatasetError(
            f"{unlike[0]}: takes images in some samples and in others not; name the same cameras in all of them"
        )
    for name, shape in shapes.items():
        if shape != wanted[name]:
            have, first = (" x ".join(map(str, sizes)) for sizes in (shape, wanted[name]))
            raise DatasetError(
                f"{name}: has {have} pixels, and with the first sensor {first}; all images of a dataset are of one size"
            )


def _choose_target(
    tables: dict[str, Any], plan: DatasetPlan, name: str | None, target_class: ClassOfTargets, draws: _Draws
) -> None:
    """Give the target of the scenario the model or the fragment of a sample, or leave it out."""
    targets = _find_targets(tables, plan)
    if name is None:
        del targets[plan.target_index]
    elif target_class.replaces_target:
        kept = {key: value for key, value in targets[plan.target_index].items() if key in _OF_ANY_MODEL}
        targets[plan.target_index] = kept | _choose_shape(name, target_class.fragments, draws, "fragment")


def _choose_shape(name: str, fragments: DrawnFragments | None, draws: _Draws, place: str) -> dict[str, Any]:
    """Return the table of a body's shape: its model, or a fragment of drawn size and seed."""
    kinds = {} if fragments is None else {name_fragments(kind): kind for kind in fragments.kinds}
    if fragments is None or name not in kinds:
        return {"model": name}
    length_m = float(draws.draw(f"{place}.characteristic_length_m", fragments.characteristic_length_m))
    seed = draws.draw(f"{place}.seed", fragments.seed)
    return {"fragment": {"kind": kinds[name], "seed": seed, "characteristic_length_m": length_m}}


def _find_targets(tables: dict[str, Any], plan: DatasetPlan) -> list[dict[str, Any]]:
    """Check that settings have kept the target that classes replace, and return the targets of a scenario."""
    targets = tables["target"]
    if not isinstance(targets, list) or not all(
        isinstance(target, dict) for target in targets[: plan.target_index + 1]
    ):
        raise DatasetError(
            "target: a setting or variable replaces the list of targets; remove that setting or variable"
        )
    if len(targets) <= plan.target_index:
        raise DatasetError(
            "target: a setting or variable removes the target that classes replace; remove that setting or variable"
        )
    return targets


def _place_view(
    tables: dict[str, Any], plan: DatasetPlan, view: RandomView, draws: _Draws, *, has_target: bool
) -> None:
    """Place the target and the clutter of a sample in front of the lidar."""
    if "ptu" in tables:
        raise DatasetError(
            "view: places the target before a lidar that does not turn; remove [ptu] from the scenario, or leave out [view]"
        )
    seat = _read_lidar(json.dumps(tables["lidar"], default=str), plan.folder)
    if has_target:
        target = _find_targets(tables, plan)[plan.target_index]
        range_m = draws.draw("view.range_m", view.range_m)
        target["motion"] = _place(range_m, draws.draw("view.offset_fraction", view.offset_fraction), seat)
        attitude: dict[str, Any] = {"type": "fixed", "quaternion_xyzw": draws.draw("view.attitude", view.attitude)}
        if view.spin_deg_s is not None:
            rate = draws.draw("view.spin_deg_s", view.spin_deg_s)
            axis = draws.draw("view.spin_axis", _AROUND)
            attitude |= {"type": "spin", "axis": axis, "rate_deg_s": rate}
        target["attitude"] = attitude
    if view.sun is not None:
        set_field(tables, "world.sun_direction", draws.draw("view.sun", view.sun), "view.sun")
    if (clutter := plan.spec.clutter) is not None:
        for k in range(draws.draw("clutter.count", clutter.count)):
            body: dict[str, Any] = {"name": f"clutter_{k}"}
            name = draws.draw(f"clutter.{k}.model", Choice(values=(*clutter.models, *name_kinds(clutter.fragments))))
            body |= _choose_shape(name, clutter.fragments, draws, f"clutter.{k}")
            range_m = draws.draw(f"clutter.{k}.range_m", clutter.range_m)
            offset = draws.draw(f"clutter.{k}.offset_fraction", clutter.offset_fraction)
            body["motion"] = _place(range_m, offset, seat)
            turn = draws.draw(f"clutter.{k}.attitude", UniformRotation())
            body["attitude"] = {"type": "fixed", "quaternion_xyzw": turn}
            tables["target"].append(body)


@lru_cache(maxsize=64)
def _read_lidar(text: str, folder: Path | None) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """Return position [m] and rotation matrix of the lidar in follower axes, and the tangents of its half field."""
    lidar = validate_tables(Lidar, json.loads(text), "lidar", folder)
    receiver = lidar.receiver
    half = 0.5 * receiver.pixel_pitch_m / receiver.focal_length_m
    turn = (lidar.mount.rotation * lidar_from_ptu().inv()).as_matrix()
    return np.array(lidar.mount.position_m, float), turn, (half * receiver.n_cols, half * receiver.n_rows)


def _place(
    range_m: float, offset: list[float], seat: tuple[np.ndarray, np.ndarray, tuple[float, float]]
) -> dict[str, Any]:
    """Return the motion of a body that is fixed in front of the lidar.

    Parameters
    ----------
    range_m : distance from the lidar [m]
    offset : right and down from the boresight, 1 at the edge of the field
    seat : position and rotation of the lidar in follower axes, and the tangents of its half field
    """
    position, turn, (across, down) = seat
    ray = np.array([offset[0] * across, offset[1] * down, 1.0])
    at = position + turn @ (range_m * ray / np.linalg.norm(ray))
    return {"type": "fixed", "relative_to": "follower", "position_m": [float(x) for x in at]}


def _choose_frames(spec: DatasetSpec, scenario: Scenario, share: float) -> tuple[int, ...]:
    """Return the numbers of a sample's frames in its scenario; the first is drawn from `share`, from 0 to below 1."""
    sequence, n_frames = spec.sequence, scenario.time.n_frames
    last = n_frames - 1 - (sequence.frames - 1) * sequence.stride
    start = sequence.start
    if start is None:
        start = 0 if spec.controller is not None else int(share * (last + 1))
    if not 0 <= start <= last:
        begin = "" if sequence.start is None else f" from frame {start}"
        raise DatasetError(
            f"sequence: {sequence.frames} frames with stride {sequence.stride}{begin} are more than the "
            f"{n_frames} of the scenario; reduce them, or raise time.duration_s"
        )
    return tuple(range(start, start + sequence.frames * sequence.stride, sequence.stride))
