"""The plan of a dataset: the order of its samples, their classes, splits and shards, and the inputs of all samples."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import json
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rso_lidar.dataset.drawing.inputs import find_meshes, hash_named_files, list_models
from rso_lidar.dataset.drawing.sample_order import BLOCK, assign_splits, choose_block, shuffle_samples
from rso_lidar.dataset.drawing.uniform_numbers import draw_shares
from rso_lidar.dataset.specification.spec import DatasetSpec, check_model_split
from rso_lidar.dataset.specification.tables import SPLITS, ClassOfTargets, ModelSplit, RandomSplit
from rso_lidar.errors import DatasetError, ScenarioError, add_place, did_you_mean
from rso_lidar.files import convert_path, expand_user
from rso_lidar.part import parse_toml
from rso_lidar.scenario import Scenario, apply_setting, read_toml
from rso_lidar.scene import models, own_models
from rso_lidar.shipped import find
from rso_lidar.user_settings import is_trusted

_DRAWING = 2  # version of the rules by which a specification becomes samples; a part of the hash of a dataset
_NUMBERING = re.compile(r"\s*target(?:\.\d+|\[\d+\])\.(keypoint_file|keypoint|facet_parts)\b")
_CHUNK = 4096  # samples whose classes are computed at once in the search for the first one of a class


class Membership(NamedTuple):
    """Class, number in the class and split of each sample; arrays (sample)."""

    target_class: np.ndarray  # i2, index of the class
    number: np.ndarray  # i8, number of the sample in its class
    split: np.ndarray  # i1, index in SPLITS


class ShardPlace(NamedTuple):
    """One shard: its split, its number in the split, and the numbers of its samples."""

    split: str
    number: int
    samples: np.ndarray

    @property
    def path(self) -> str:
        """Path in the dataset's folder."""
        return f"{self.split}/{self.number:06d}.h5"


@dataclass(frozen=True, eq=False)
class DatasetPlan:
    """All inputs of a dataset, which worker processes receive.

    `tables` holds the base scenario with the settings of the specification, and `class_models` the models of each class.
    `mesh_sha256` and `part_names` hold the hash and the parts of each mesh by model, and `file_sha256` the hash of each
    other file by the name that the scenario or the specification states. `trust_code` and `trust_fmu` are whether Python
    code and FMUs that the scenario names may run.
    """

    spec: DatasetSpec
    tables: dict[str, Any]
    folder: Path
    where: str
    class_models: tuple[tuple[str, ...], ...]
    mesh_sha256: dict[str, str]
    part_names: dict[str, tuple[str, ...]]
    file_sha256: dict[str, str]
    trust_code: bool = False
    trust_fmu: bool = False

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields without cached properties, which another process computes again."""
        return {field.name: self.__dict__[field.name] for field in dataclasses.fields(self)}

    @cached_property
    def keypoints(self) -> dict[str, tuple[str, ...]]:
        """Names of the keypoints of each model; none of fragments, and of meshes that only a class names."""
        known = {name: entry for name, entry in {**own_models(), **models()}.items() if name in self.models}
        names = {name: tuple(point.name for point in entry.keypoints) for name, entry in known.items()}
        own = self.scenario().source.targets[self.target_index].keypoints
        for target_class, of_class in zip(self.spec.classes, self.class_models, strict=True):
            if not (target_class.empty or target_class.replaces_target):
                names[of_class[0]] = tuple(point.name for point in own)
        return {name: names.get(name, ()) for name in self.models}

    @property
    def most_keypoints(self) -> int:
        """Greatest number of keypoints of a model."""
        return max(map(len, self.keypoints.values()), default=0)

    @cached_property
    def target_index(self) -> int:
        """Index of the scenario's target that classes replace."""
        return _find_target(self.spec, self.tables)

    @cached_property
    def models(self) -> tuple[str, ...]:
        """Names of all models of all classes, each once, in the order of the classes."""
        return tuple(dict.fromkeys(name for names in self.class_models for name in names))

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes with targets."""
        return tuple(target_class.name for target_class in self.spec.classes if not target_class.empty)

    @cached_property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(sensor.name for sensor in self.spec.sensor) or ("sensor",)

    @cached_property
    def sha256(self) -> str:
        """Hash of all inputs of the samples: the specification, the base scenario, the meshes and all other files."""
        own = self.spec.model_dump(exclude_none=True, exclude={"scenario", "set"})  # both are in the tables
        for key in ("camera_electrons", "keypoints", "normals"):  # which earlier versions do not know
            if not own["labels"][key]:
                del own["labels"][key]
        inputs = [_DRAWING, own, self.mesh_sha256, self.tables, *([self.file_sha256] if self.file_sha256 else [])]
        inputs += [{"labels_of_models": labels}] if (labels := _list_own_labels(self.models)) else []
        rule = self.spec.split
        if isinstance(rule, RandomSplit) and (block := choose_block(rule.val, rule.test)) != BLOCK:
            inputs.append({"split_block": block})
        text = json.dumps(inputs, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    def scenario(self) -> Scenario:
        """Build the base scenario."""
        return self.build(copy.deepcopy(self.tables))

    def build(self, tables: dict[str, Any]) -> Scenario:
        """Build a scenario of the dataset from its tables."""
        scenario = Scenario.from_tables(tables, folder=self.folder, where=self.where, trust_code=self.trust_code)
        return scenario.with_trusted_fmus() if self.trust_fmu else scenario

    def copy_tables(self, sensor: int) -> dict[str, Any]:
        """Return a copy of the tables with the settings of a sensor, by its number."""
        tables = copy.deepcopy(self.tables)
        for setting in self.spec.sensor[sensor].set if self.spec.sensor else ():
            apply_setting(tables, setting)
        return tables

    @cached_property
    def image_shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of all images, see `find_shapes`: those of the first sensor."""
        return find_shapes(self.build(self.copy_tables(0)))

    @cached_property
    def membership(self) -> Membership:
        """Class, number and split of all samples.

        The order of samples is random, and a class that gets more samples keeps those that it had.
        """
        target_class, number = self._find_classes(np.arange(self.spec.n_samples))
        split = np.zeros(len(number), np.int8)
        for k, class_of_targets in enumerate(self.spec.classes):
            mine = np.flatnonzero(target_class == k)
            split[mine] = self._assign(class_of_targets, k, number[mine])
        return Membership(target_class, number, split)

    @cached_property
    def _ends(self) -> np.ndarray:
        """Number of samples of each class and of all before it (class)."""
        return np.cumsum([target_class.samples for target_class in self.spec.classes])

    def _find_classes(self, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the class (sample) of samples, and their numbers in it."""
        number = shuffle_samples(self.spec.seed, index, self.spec.n_samples)
        target_class = np.searchsorted(self._ends, number, side="right").astype(np.int16)
        number -= np.concatenate(([0], self._ends[:-1]))[target_class]
        return target_class, number

    def place_sample(self, index: int) -> tuple[int, int, str]:
        """Return the class of a sample, its number in the class and its split, without those of all others."""
        target_class, number = self._find_classes(np.array([index]))
        k = int(target_class[0])
        return k, int(number[0]), SPLITS[int(self._assign(self.spec.classes[k], k, number)[0])]

    def find_first(self, k: int) -> int:
        """Return the number of the first sample of a class, without the classes of all others."""
        for begin in range(0, self.spec.n_samples, _CHUNK):
            target_class, _ = self._find_classes(np.arange(begin, min(begin + _CHUNK, self.spec.n_samples)))
            if (target_class == k).any():
                return begin + int((target_class == k).argmax())
        raise DatasetError(f"{self.spec.where}: has no sample of class {k}; choose one of its classes")

    def _assign(self, target_class: ClassOfTargets, k: int, number: np.ndarray) -> np.ndarray:
        """Return the split (sample) of samples of one class, by their numbers (sample) in it."""
        rule = self.spec.split
        if isinstance(rule, RandomSplit):
            return assign_splits(self.spec.seed, target_class.name, number, rule.val, rule.test)
        if isinstance(rule, ModelSplit):
            names = list(self.class_models[k])
            chosen = self.choose_model(k, number)
        else:
            names = list(self.sensors)
            chosen = self.choose_sensor(k, number)
        of = np.array([2 if name in rule.test else 1 if name in rule.val else 0 for name in names])
        assigned: np.ndarray = of[chosen]
        return assigned

    def choose_model(self, k: int, number: np.ndarray) -> np.ndarray:
        """Return the index (sample) of each sample's model among those of its class."""
        return self._choose(k, number, "model", len(self.class_models[k]))

    def choose_sensor(self, k: int, number: np.ndarray) -> np.ndarray:
        """Return the index (sample) of each sample's sensor."""
        return self._choose(k, number, "sensor", len(self.sensors))

    def _choose(self, k: int, number: np.ndarray, what: str, count: int) -> np.ndarray:
        """Choose one of `count` equal options for each number (sample); `what` is part of the random address."""
        share = draw_shares(self.spec.seed, self.spec.classes[k].name, number, what)[:, 0]
        chosen: np.ndarray = (share * count).astype(np.int64)
        return chosen

    @cached_property
    def _members(self) -> tuple[np.ndarray, ...]:
        """Numbers of the samples of each split, ascending."""
        return tuple(np.flatnonzero(self.membership.split == k) for k in range(len(SPLITS)))

    def count_samples(self) -> np.ndarray:
        """Count samples (class, split)."""
        counts = np.zeros((len(self.spec.classes), len(SPLITS)), np.int64)
        np.add.at(counts, (self.membership.target_class, self.membership.split), 1)
        return counts

    @cached_property
    def n_shards(self) -> int:
        """Number of shards of all splits."""
        return sum(self._count_shards())

    def _count_shards(self) -> tuple[int, ...]:
        return tuple(-(-len(members) // self.spec.samples_per_shard) for members in self._members)

    def shard(self, number: int) -> ShardPlace:
        """Return one shard by its number. Shards are counted over all splits, train first."""
        for k, count in enumerate(self._count_shards()):
            if number < count:
                each = self.spec.samples_per_shard
                return ShardPlace(SPLITS[k], number, self._members[k][number * each : (number + 1) * each])
            number -= count
        raise DatasetError(f"{self.spec.where}: has {self.n_shards} shards; choose one of them")


def make_plan(
    given: DatasetSpec | str | Path, *, files: Path | None = None, trust_code: bool = False, trust_fmu: bool = False
) -> DatasetPlan:
    """Check the base scenario, models and split of a specification, and make the plan of its dataset.

    Parameters
    ----------
    files : folder in which relative paths of meshes and orbit files start (None: that of the scenario)
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, may run that the scenario names

    Raises
    ------
    ScenarioError, DatasetError
        For a specification or a scenario that is not valid.
    """
    spec = given if isinstance(given, DatasetSpec) else DatasetSpec.load(convert_path(given, ScenarioError))
    path = find(expand_user(spec.scenario), spec.folder) or find(Path("examples", spec.scenario))
    if path is None:
        raise DatasetError(
            f"{spec.where}: scenario: no file '{spec.scenario}' beside it nor among the shipped examples; check the name"
        )
    tables = parse_toml(read_toml(path), path.name, ScenarioError)
    with add_place(spec.where):
        for setting in spec.set:
            apply_setting(tables, setting)
    trust_code, trust_fmu = trust_code or is_trusted("trust_code", path), trust_fmu or is_trusted("trust_fmu", path)
    folder = files or path.parent
    plan = DatasetPlan(spec, tables, folder, path.name, (), {}, {}, {}, trust_code, trust_fmu)
    with add_place(spec.where):
        base = plan.scenario()
        _find_target(spec, tables)
        _check_class_settings(spec)
        named = tuple(list_models(spec, target_class, base) for target_class in spec.classes)
        check_model_split(spec, list(named))
        meshes = find_meshes(spec, named, base, folder)
        hashes = {name: meshes[name].sha256 for name in sorted(meshes)}
        parts = {name: mesh.part_names for name, mesh in meshes.items()}
        files_named = hash_named_files(spec, tables, folder)
    plan = DatasetPlan(spec, tables, folder, path.name, named, hashes, parts, files_named, trust_code, trust_fmu)
    _check_split(plan)
    return plan


def _list_own_labels(names: tuple[str, ...]) -> dict[str, list[Any]]:
    """List what the user's own library says of labels, beside the mesh files: tables of parts, and keypoints."""
    own = own_models()
    labels = {
        name: [own[name].facet_parts_sha256, [point.model_dump(mode="json") for point in own[name].keypoints]]
        for name in names
        if name in own
    }
    return {name: entry for name, entry in labels.items() if any(entry)}


def _check_class_settings(spec: DatasetSpec) -> None:
    """Refuse settings of a class that would number its parts or keypoints otherwise than the dataset's constants do."""
    for target_class in spec.classes:
        for setting in target_class.set:
            if words := _NUMBERING.match(setting):
                raise DatasetError(
                    f"classes: {target_class.name}: set: {words[1]} cannot differ from class to class; give it in the "
                    "scenario, or add the mesh to your library with `rso-lidar models add`"
                )


def find_shapes(scenario: Scenario) -> dict[str, tuple[int, ...]]:
    """Return rows and columns of the lidar's images, and rows, columns and bands of each camera's."""
    receiver = scenario.lidar.receiver
    cameras = {f"camera {camera.name}": camera.shape for camera in scenario.camera}
    return {"lidar": (receiver.n_rows, receiver.n_cols), **cameras}


def _find_target(spec: DatasetSpec, tables: dict[str, Any]) -> int:
    """Return the index of the target that classes replace, or raise `DatasetError`."""
    names = [target.get("name") for target in tables.get("target", [])]
    if not names:
        raise DatasetError("target: the scenario has no target for the classes to replace; add a [[target]]")
    if spec.target is None:
        return 0
    if spec.target not in names:
        raise DatasetError(f"target: none is named '{spec.target}'{did_you_mean(spec.target, names)}; correct the name")
    return names.index(spec.target)


def _check_split(plan: DatasetPlan) -> None:
    """Raise `DatasetError` if a class has no sample in a split that should have some."""
    spec, rule = plan.spec, plan.spec.split
    counts = plan.count_samples()
    for k, target_class in enumerate(spec.classes):
        if isinstance(rule, ModelSplit):
            held = {*plan.class_models[k]}
            wanted = [True, bool(held & {*rule.val}), bool(held & {*rule.test})]
        else:
            wanted = [True, bool(rule.val), bool(rule.test)]
        for split in np.flatnonzero(np.array(wanted) & (counts[k] == 0)).tolist():
            least = f"{sum(wanted)} samples or more" if isinstance(rule, RandomSplit) else "more samples"
            raise DatasetError(
                f"{spec.where}: split: no sample of class '{target_class.name}' is in {SPLITS[split]}; give it {least}, or "
                "leave out a split"
            )
