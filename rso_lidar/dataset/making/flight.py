"""The frames of one sample, each with its noise draws, as labelled frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from rso_lidar import detector
from rso_lidar.dataset.annotation.frame_labels import label_frame, number_part_classes
from rso_lidar.dataset.annotation.part_visibility import measure_part_visibility
from rso_lidar.dataset.drawing.plan import DatasetPlan
from rso_lidar.dataset.drawing.sample import Sample, draw_sample
from rso_lidar.dataset.shards.layout import LabelledFrame, LabelledImage
from rso_lidar.dataset.specification.tables import OptionalLabels
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.records import PART_CLASSES, CameraLabels, Command, Frame, Labels, Observation, Source, find_box
from rso_lidar.scenario import Scenario
from rso_lidar.simulation import DETECTION, find_normals, flash, read_images, simulate
from rso_lidar.track import Pointing
from rso_lidar.units import MS


def list_kept(labels: OptionalLabels) -> tuple[str, ...]:
    """List the intermediate records that the labels and further noise draws of a dataset need."""
    return (
        "hits",
        "signal",
        "photons",
        *(("oversampled",) if labels.oversampled else ()),
    )


def fly_sample(plan: DatasetPlan, sample: Sample) -> Iterator[tuple[LabelledFrame, dict[str, float]]]:
    """Fly one sample, and yield its labelled frames with the drawn numbers: by step, then by noise draw."""
    drawn = list_numbers(sample)
    for step, flown, command in _fly(plan, sample):
        frame = _predict(plan, sample, flown, command)
        yield label(plan, sample, frame, step, 0), drawn
        for draw, seed in enumerate(sample.seeds[1:], 1):
            yield label(plan, sample, _draw_again(plan, sample, frame, command, seed), step, draw), drawn


def list_numbers(sample: Sample) -> dict[str, float]:
    """List the drawn numbers of a sample by name; vectors by component."""
    numbers: dict[str, float] = {}
    for name, value in sample.values.items():
        if name.startswith("clutter."):
            continue
        for place, number in enumerate(value) if isinstance(value, list | tuple) else ((None, value),):
            if type(number) in (int, float):
                numbers[name if place is None else f"{name}.{place}"] = float(number)
    return numbers


def _fly(plan: DatasetPlan, sample: Sample) -> Iterator[tuple[int, Frame, Command | None]]:
    """Yield the frames of a sample with their places in the sequence and the commands that they were made under."""
    keep = list_kept(plan.spec.labels)
    if plan.spec.controller is None:
        for step, frame in enumerate(simulate(sample.scenario, frames=sample.frames, threads=1, keep=keep)):
            yield step, frame, None
        return
    asked = plan.spec.controller.model_dump(exclude={"type"})
    point = Pointing(**asked, mount=sample.scenario.lidar.mount)
    commands: list[Command | None] = [None]

    def control(observation: Observation) -> Command:
        commands.append(point(observation))
        return commands[-1] or Command()

    steps = {frame: step for step, frame in enumerate(sample.frames)}
    for frame in simulate(sample.scenario, control, threads=1, keep=keep):
        if frame.index in steps:
            yield steps[frame.index], frame, commands[frame.index]
        if frame.index >= sample.frames[-1]:
            return


def _predict(plan: DatasetPlan, sample: Sample, frame: Frame, command: Command | None) -> Frame:
    """Add the prediction of each pixel to what a frame keeps, if the labels of the dataset hold it."""
    if not plan.spec.labels.prediction:
        return frame
    photons: Any = frame.kept["photons"]
    part = sample.scenario.instrument.at(frame.time_s, command).detector
    prediction = detector.predict_pixels(photons, part, frame.labels.range_m, by_table=not plan.spec.draws_detector)
    return replace(frame, kept={**frame.kept, "prediction": prediction})


def _draw_again(plan: DatasetPlan, sample: Sample, frame: Frame, command: Command | None, seed: int) -> Frame:
    """Make a frame again from the same poses, with the noise of another seed.

    If nothing before the detector is random, the light of the first draw is detected again. Otherwise the whole flash is
    made again, because jitter of the pulse and random paths of bounces are noise too. Cameras read the same light again.
    """
    scenario = sample.scenario
    lidar = scenario.instrument.at(frame.time_s, command)
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(frame.index, DETECTION))))
    if lidar.bounces > 1 or lidar.laser.has_jitter:
        kept = list_kept(plan.spec.labels)
        again = flash(scenario, frame.truth, rng, 1, lidar=lidar, index=frame.index, keep=kept)
        again = _predict(plan, sample, again, command)
    else:
        photons: Any = frame.kept["photons"]
        reading, _ = detector.detect(photons, lidar.detector, rng, 1)
        again = replace(frame, observation=replace(frame.observation, reading=reading))
    if not scenario.camera:
        return again
    images = read_images(scenario.replace(seed=seed), again)
    return replace(again, observation=replace(again.observation, camera=images))


def label(plan: DatasetPlan, sample: Sample, frame: Frame, step: int, draw: int) -> LabelledFrame:
    """Label one frame.

    Parameters
    ----------
    plan, sample : of the dataset
    frame : of the sample, with the records of `list_kept`
    step, draw : place in the sequence, and number of the noise draw
    """
    scenario, labels = sample.scenario, frame.labels
    labelling = label_frame(frame, scenario, sample.target)
    position, quaternion = _find_pose(sample, frame, "lidar")
    sun = rotate_vectors(frame.truth.pose("lidar", ROOT).rotation, frame.truth.sun_direction)
    optional: dict[str, Any] = {}
    if plan.spec.labels.prediction:
        predicted: Any = frame.kept["prediction"]
        optional |= {name: getattr(predicted, name) for name in ("detection_probability", "range_sigma_m")}
    if plan.spec.labels.part_visibility:
        optional["part_visibility"] = measure_part_visibility(frame, scenario, sample.target)
    if plan.spec.labels.oversampled:
        fine: Any = frame.kept["oversampled"]
        optional |= {"oversampled_range_m": fine.range_m, "oversampled_photons": fine.photons}
    if plan.spec.labels.normals:
        optional["normal"] = find_normals(frame, scenario)
    if plan.spec.labels.keypoints:
        optional |= _pad_keypoints(frame.source, labels, sample.target, plan.most_keypoints)
    return LabelledFrame(
        range_m=frame.range_m,
        intensity_counts=frame.intensity_counts,
        saturated=frame.observation.reading.saturated,
        true_range_m=labels.range_m,
        photons=labels.photons,
        target=number_bodies(labels.target, sample.target),
        part=labels.part,
        part_class_id=labelling.part_class_id,
        sample=sample.index,  # type: ignore[arg-type]  # records take what becomes an array
        step=step,  # type: ignore[arg-type]
        draw=draw,  # type: ignore[arg-type]
        seed=sample.seeds[draw],  # type: ignore[arg-type]
        frame_number=frame.index,  # type: ignore[arg-type]
        time_s=frame.time_s,  # type: ignore[arg-type]
        class_id=sample.class_id,  # type: ignore[arg-type]
        model_id=-1 if sample.model is None else plan.models.index(sample.model),  # type: ignore[arg-type]
        sensor_id=sample.sensor_id,  # type: ignore[arg-type]
        present=int(sample.target is not None),  # type: ignore[arg-type]
        position_m=position,
        quaternion_xyzw=quaternion,
        range_to_target_m=labelling.range_to_target_m,  # type: ignore[arg-type]
        lit_pixels=labelling.lit_pixels,  # type: ignore[arg-type]
        reporting_pixels=labelling.reporting_pixels,  # type: ignore[arg-type]
        total_photons=labelling.total_photons,  # type: ignore[arg-type]
        box_px=labelling.box_px,
        intrinsics_px=_find_intrinsics(scenario, frame),
        sun_direction=sun,
        part_light_fraction=labelling.part_light_fraction,
        camera=_label_images(plan, sample, frame),
        **optional,
    )


def _label_images(plan: DatasetPlan, sample: Sample, frame: Frame) -> dict[str, LabelledImage]:
    """Label the images of the cameras beside the lidar, by name."""
    images: dict[str, LabelledImage] = {}
    class_of = number_part_classes(sample.scenario.source, tuple(PART_CLASSES))
    for camera in sample.scenario.camera:
        image, labels = frame.camera[camera.name], frame.camera_labels[camera.name]
        position, quaternion = _find_pose(sample, frame, camera.name)
        hit = np.nonzero(labels.target >= 0)  # mostly a small part of the pixels
        target, part = labels.target[hit], labels.part[hit]
        bodies, classes = np.full(labels.target.shape, -1, np.int8), np.full(labels.target.shape, -1, np.int8)
        bodies[hit], classes[hit] = number_bodies(target, sample.target), class_of[target, part]
        on_target = (bodies == 0) & (sample.target is not None)
        is_greatest = image.intensity_counts == camera.sensor.greatest_count
        is_full = (is_greatest | (labels.electrons >= camera.sensor.full_well_electrons)).any(axis=2)
        focal_px = camera.lens.focal_length_m / camera.lens.pixel_pitch_m
        optional: dict[str, Any] = {}
        if plan.spec.labels.camera_electrons:
            optional["electrons"] = labels.electrons
        if plan.spec.labels.normals:
            optional["normal"] = find_normals(frame, sample.scenario, camera.name)
        if plan.spec.labels.keypoints:
            optional |= _pad_keypoints(frame.source, labels, sample.target, plan.most_keypoints)
        images[camera.name] = LabelledImage(
            intensity_counts=image.intensity_counts,
            target=bodies,
            part=labels.part,
            part_class_id=classes,
            range_m=labels.range_m,
            filled_fraction=labels.filled_fraction,
            exposure_s=image.exposure_s,
            start_s=camera.start_ms * MS,  # type: ignore[arg-type]  # records take what becomes an array
            position_m=position,
            quaternion_xyzw=quaternion,
            target_pixels=int(on_target.sum()),  # type: ignore[arg-type]
            target_electrons=float(labels.electrons[on_target].sum(dtype=float)),  # type: ignore[arg-type]
            full_pixels=int(is_full.sum()),  # type: ignore[arg-type]
            box_px=find_box(on_target),
            intrinsics_px=np.array(
                [focal_px, focal_px, 0.5 * (camera.lens.n_cols - 1), 0.5 * (camera.lens.n_rows - 1)]
            ),
            **optional,
        )
    return images


def _find_pose(sample: Sample, frame: Frame, axes: str) -> tuple[np.ndarray, np.ndarray]:
    """Return position [m] and quaternion of the sample's target in some axes at the flash; NaN without a target."""
    if sample.target is None:
        return np.full(3, np.nan), np.full(4, np.nan)
    pose = frame.truth.pose(axes, sample.scenario.target[sample.target].name)
    return np.asarray(pose.translation), pose.rotation.as_quat(canonical=True)


def _pad_keypoints(source: Source, labels: Labels | CameraLabels, own: int | None, count: int) -> dict[str, np.ndarray]:
    """Return place and visibility of the keypoints of a sample's target, in arrays for as many points as any model has."""
    if not count:
        return {}
    place_px, visibility = np.full((count, 2), np.nan, np.float32), np.zeros(count, np.uint8)
    if own is not None and labels.keypoint_px is not None and labels.keypoint_visibility is not None:
        mine = source.find_keypoints(own)
        points = mine.stop - mine.start
        place_px[:points], visibility[:points] = labels.keypoint_px[mine], labels.keypoint_visibility[mine]
    return {"keypoint_px": place_px, "keypoint_visibility": visibility}


def number_bodies(target: np.ndarray, own: int | None) -> np.ndarray:
    """Number the bodies of a frame alike with and without a target: 0 is the sample's target, from 1 on are others.

    Parameters
    ----------
    target : (row, col), index of the target in the scenario, -1 for sky
    own : index of the sample's target; None without one

    >>> number_bodies(np.array([-1, 0, 1, 2]), 1), number_bodies(np.array([-1, 0, 1]), None)
    (array([-1,  1,  0,  2]), array([-1,  1,  2]))
    """
    others = np.where(target >= 0, target + 1, target)
    if own is None:
        return others
    return np.where(target == own, 0, np.where(target > own, target, others))


def _find_intrinsics(scenario: Scenario, frame: Frame) -> np.ndarray:
    """Return fx, fy, cx, cy [px] of a frame's lens without its distortion; (0, 0) is the centre of the first pixel."""
    receiver = scenario.lidar.receiver
    focal_px = frame.observation.settings["focal_length_m"] / receiver.pixel_pitch_m
    return np.array([focal_px, focal_px, 0.5 * (receiver.n_cols - 1), 0.5 * (receiver.n_rows - 1)])


def list_names(plan: DatasetPlan) -> tuple[str, ...]:
    """List the names of all numbers that a dataset draws, from the first sample of each class."""
    names: dict[str, None] = {}
    for k in range(len(plan.spec.classes)):
        names |= dict.fromkeys(list_numbers(draw_sample(plan, plan.find_first(k))))
    return tuple(names)
