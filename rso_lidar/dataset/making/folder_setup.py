"""The folder of a dataset: begun, joined by later runs, and freed of what a killed run left."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from rso_lidar.dataset.drawing.inputs import name_model
from rso_lidar.dataset.drawing.plan import DatasetPlan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.reading.random_access import SPEC_FILE
from rso_lidar.dataset.shards.manifest import MANIFEST, ShardRecord, read_manifest
from rso_lidar.dataset.shards.sensor_file import (
    SENSOR_FILE,
    SENSOR_HASH,
    CameraConstants,
    Constants,
    read_constants,
    write_constants,
)
from rso_lidar.dataset.shards.shard_file import list_drafts
from rso_lidar.dataset.specification.tables import SPLITS
from rso_lidar.errors import DatasetError
from rso_lidar.files import advise_on_write, hold_lock, write_text
from rso_lidar.motion import Fixed
from rso_lidar.records import PART_CLASSES
from rso_lidar.scenario import Target, find_symmetry
from rso_lidar.scene import is_mesh_path

SCENARIO_FILE = "scenario.toml"
_LOCK = ".dataset.lock"
_LOCK_WAIT_S = 120.0  # to set up a folder takes seconds, with the meshes of all models


def begin_folder(plan: DatasetPlan, folder: Path, *, join: bool) -> None:
    """Begin the folder of a dataset, or join one that was begun with the same specification.

    Parameters
    ----------
    join : whether a folder that was begun before may be continued

    Raises
    ------
    DatasetError
        If the folder holds something else, or may not be written.
    RunError
        If writing fails.
    """
    try:
        if folder.exists() and not folder.is_dir():
            raise DatasetError(f"{folder}: is a file; name a folder")
        if (
            folder.is_dir()
            and not (folder / SENSOR_FILE).exists()
            and not (join and (folder / MANIFEST).is_file())
            and any(
                path.name not in (_LOCK, SPEC_FILE, SCENARIO_FILE, SENSOR_HASH, *SPLITS) and ".part" not in path.name
                for path in folder.iterdir()
            )
        ):
            raise DatasetError(f"{folder}: holds other files; name a new folder")
        for split in SPLITS:
            (folder / split).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be written ({error.strerror}); {advise_on_write(error.errno)}") from None
    with hold_lock(folder / _LOCK, wait_s=_LOCK_WAIT_S, busy=f"{folder}: another run is beginning it; try again"):
        if (folder / SENSOR_FILE).exists():
            _check_joined(plan, folder, join=join)
            return
        import tomli_w

        read_manifest(folder, plan.sha256)  # which refuses the shards of another dataset, if the sensor file was lost
        write_text(folder / SCENARIO_FILE, tomli_w.dumps(plan.tables), overwrite=True)
        own = plan.spec.replace(scenario=SCENARIO_FILE, set=())
        write_text(folder / SPEC_FILE, own.dumps(), overwrite=True)
        write_constants(folder, list_constants(plan))  # last: a folder with this file is a dataset


def _check_joined(plan: DatasetPlan, folder: Path, *, join: bool) -> None:
    """Raise `DatasetError` for a folder that may not be continued, or may not without `join`."""
    if read_constants(folder).sha256 != plan.sha256:
        raise DatasetError(
            f"{folder}: holds the dataset of another specification, or a file that it names has changed; name another folder"
        )
    if not join:
        raise DatasetError(f"{folder}: holds this dataset already; continue it with --resume, or name another folder")


def list_constants(plan: DatasetPlan) -> Constants:
    """List the names and constants of a dataset."""
    lidars, lines, cameras = {}, {}, {}
    for k, name in enumerate(plan.sensors):
        scenario = plan.build(plan.copy_tables(k))
        lidars[name] = json.dumps(scenario.lidar.model_dump(mode="json", exclude_none=True))
        lines[name] = scenario.instrument.receiver.line_of_sight
        cameras[name] = {
            camera.name: CameraConstants(
                json.dumps(camera.model_dump(mode="json", exclude_none=True)), resolved.lens.line_of_sight
            )
            for camera, resolved in zip(scenario.camera, scenario.cameras, strict=True)
        }
    return Constants(
        sha256=plan.sha256,
        title=plan.spec.name,
        classes=plan.classes,
        models=plan.models,
        sensors=plan.sensors,
        part_classes=tuple(PART_CLASSES),
        splits=SPLITS,
        model_parts={name: plan.part_names[name] for name in plan.models},
        model_keypoints=plan.keypoints if plan.spec.labels.keypoints else {},
        symmetries=_find_symmetries(plan),
        line_of_sight=lines,
        lidars=lidars,
        file_sha256=plan.file_sha256,
        cameras=cameras,
    )


def _find_symmetries(plan: DatasetPlan) -> dict[str, dict[str, Any] | None]:
    """Return the symmetry of each model: that of the catalogue, or of the scenario's own target where a class keeps it."""
    symmetries: dict[str, dict[str, Any] | None] = dict.fromkeys(plan.models)
    for target_class, names in zip(plan.spec.classes, plan.class_models, strict=True):
        if target_class.models or target_class.taxonomy is not None:
            symmetries |= {name: _find_symmetry(name) for name in names}
    for k, target_class in enumerate(plan.spec.classes):
        if target_class.empty or target_class.replaces_target:
            continue
        first = draw_sample(plan, plan.find_first(k))
        target = first.scenario.target[plan.target_index]
        own = find_symmetry(target)
        symmetries[name_model(target)] = None if own is None else own.model_dump(exclude_none=True)
    return symmetries


def _find_symmetry(name: str) -> dict[str, Any] | None:
    """Return the symmetry of a model of the catalogue in its body axes, with hinges at zero; None of another mesh."""
    if is_mesh_path(name):
        return None
    symmetry = find_symmetry(Target(name="target", model=name, motion=Fixed(position_m=(0.0, 0.0, 0.0))))
    return None if symmetry is None else symmetry.model_dump(exclude_none=True)


def remove_drafts(folder: Path, finished: dict[str, ShardRecord]) -> None:
    """Remove the temporary files that killed runs left of shards that are finished now."""
    for draft in list_drafts(folder):
        if f"{draft.parent.name}/{draft.name.partition('.')[0]}.h5" in finished:
            with suppress(OSError):
                draft.unlink()
