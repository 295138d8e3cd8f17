"""One laser flash: a photon goes through the rooms once, in order, and never turns back."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np

from rso_lidar import detector, imaging, optics, sampling, scene
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Laser
from rso_lidar.philox import draw_key
from rso_lidar.records import (
    CameraImage,
    CameraLabels,
    Frame,
    Labels,
    Observation,
    Reading,
    Record,
    SensorSamples,
    Truth,
)
from rso_lidar.scenario import Lidar, Scenario, require_scenario
from rso_lidar.simulation.keypoint_labels import label_camera_keypoints, label_keypoints

_CAMERAS = 1000  # first of the stages of noise of the cameras, in their order
KEPT = ("rays", "hits", "signal", "photons", "taps", "waveforms", "oversampled", "prediction")


def flash(
    scenario: Scenario,
    truth: Truth,
    rng: np.random.Generator,
    threads: int | None = None,
    *,
    lidar: Lidar | None = None,
    index: int = 0,
    keep: tuple[str, ...] = (),
    sensors: Mapping[str, SensorSamples] | None = None,
    cameras: Collection[str] | None = None,
) -> Frame:
    """Simulate the frame of one laser pulse, or of those that the detector averages. Call its lines for what is between.

    Parameters
    ----------
    scenario : to be simulated
    truth : poses of all bodies at one epoch; its `exposure` says how they move while the pulses of the frame are sent
    rng : generator of all noise of this frame
    threads : number of threads (None: one per core). The result is bit for bit the same
    lidar : the instrument with the settings in force (None: as planned for this time)
    index : of the frame
    keep : names of intermediate records to leave in ``frame.kept``
    sensors : samples of other sensors since the flash before, by name
    cameras : names of the cameras beside the lidar that take images (None: all of them)

    Returns
    -------
    Frame
    """
    require_scenario(scenario, "flash")
    surfaces, lidar = scenario.surfaces, lidar or scenario.instrument.at(truth.time_s)
    receiver, pulses = lidar.receiver, lidar.detector.traits.pulses
    laser, late_s, jitter = lidar.laser.fire_pulses(rng, pulses)
    by_epoch, with_stray_light = [], []
    for emitted in truth.cast_epochs:  # several where a frame has several pulses and the scene moves between them
        at = scenario.apply_light_time(emitted)
        hits = sampling.cast_pixels(receiver, laser, surfaces, at, threads)
        if scenario.world.earth_albedo is not None:
            hits = scene.add_earthshine(hits, surfaces, at, scenario.world.earth_albedo, threads)
        bounces = None
        if lidar.bounces > 1:
            key = draw_key(rng)
            bounces = scene.bounce(hits, surfaces, at, key, threads, laser_from_m=laser.offset, most=lidar.bounces)
        photons = optics.collect(hits, laser, receiver, late_s, bounces)
        by_epoch.append((hits, photons))
        if receiver.has_stray_light:
            moon_m = scenario.moon_position_m(at.time_s)
            sky = optics.see_sky(laser, receiver, at, moon_m, has_earth=not scenario.is_local)
            hidden = None if sky is None else scene.find_hidden(sky.direction, surfaces, at)
            stray = optics.add_stray_light(photons, hits, laser, receiver, sky, hidden, pulses)
            with_stray_light.append((hits, stray))
    hits, photons = optics.average_pulses(by_epoch, pulses, jitter)
    signal = photons
    labels = scene.label(hits, signal, lidar.max_returns)  # of what is really there: without stray light
    if with_stray_light:
        _, photons = optics.average_pulses(with_stray_light, pulses, jitter)
    taps = None
    if "taps" in keep:
        reading, waveforms, taps = detector.detect_with_taps(photons, lidar.detector, rng, threads)
    else:
        reading, waveforms = detector.detect(photons, lidar.detector, rng, threads)
    labels = detector.label_flags(lidar.detector, labels, photons, reading)
    labels = replace(labels, **label_keypoints(scenario, scenario.apply_light_time(truth), receiver))
    records: dict[str, Record | None] = {"rays": hits.rays, "hits": hits, "signal": signal, "photons": photons}
    records |= {"taps": taps, "waveforms": waveforms}
    if "oversampled" in keep:
        grid = receiver.replace(rays_per_pixel=receiver.rays_per_side**2)
        if grid != receiver:  # rays of a fixed grid fill every cell of the finer image
            hits = sampling.cast_pixels(
                grid, laser, surfaces, scenario.apply_light_time(truth.cast_epochs[-1]), threads
            )
        records["oversampled"] = optics.oversample(hits, laser, grid)
    if "prediction" in keep:
        records["prediction"] = detector.predict_pixels(photons, lidar.detector, labels.range_m, threads=threads)
    kept = {name: record for name in keep if (record := records[name]) is not None}
    images = take_images(scenario, truth, laser, pulses, index, threads, cameras) if scenario.camera else {}
    return assemble_frame(scenario, truth, lidar, index, reading, labels, kept, sensors, images)


def take_images(
    scenario: Scenario,
    truth: Truth,
    laser: Laser,
    pulses: int,
    index: int,
    threads: int | None = None,
    cameras: Collection[str] | None = None,
) -> dict[str, tuple[CameraImage, CameraLabels]]:
    """Take the image of each camera beside the lidar about one flash.

    Parameters
    ----------
    scenario : with its cameras
    truth : poses of all bodies at the flash
    laser : with the energy of these pulses
    pulses : number of pulses of the frame
    index : of the frame, which selects the noise
    threads : number of threads (None: one per core). The result is bit for bit the same
    cameras : names of those that take an image (None: all)

    Returns
    -------
    Image and labels of each camera, by name.
    """
    flash = imaging.Flash(laser, pulses, scenario.surfaces)
    natural = scenario.find_natural_light(truth.time_s)
    images = {}
    for number, camera in enumerate(scenario.cameras):
        if cameras is not None and camera.name not in cameras:
            continue
        surfaces = scenario.camera_surfaces[camera.name]
        noise = scenario.rng(index, _CAMERAS + number)
        image, labels = imaging.take_image(camera, truth, surfaces, natural, flash, noise, threads)
        keypoints = label_camera_keypoints(scenario, truth, camera, image)
        images[camera.name] = image, replace(labels, **keypoints)
    return images


def read_images(scenario: Scenario, frame: Frame) -> dict[str, CameraImage]:
    """Draw the noise of a frame's images again, for the same light and exposures.

    Parameters
    ----------
    scenario : of the frame, with the seed of the noise
    frame : with labels of its images

    Returns
    -------
    The image of each camera, by name.
    """
    images = {}
    for number, camera in enumerate(scenario.cameras):
        light, exposure_s = frame.camera_labels[camera.name].electrons, float(frame.camera[camera.name].exposure_s)
        noise = scenario.rng(frame.index, _CAMERAS + number)
        images[camera.name] = imaging.read_image(camera, light, exposure_s, noise)
    return images


def assemble_frame(
    scenario: Scenario,
    truth: Truth,
    lidar: Lidar,
    index: int,
    reading: Reading,
    labels: Labels,
    kept: dict[str, Record],
    sensors: Mapping[str, SensorSamples] | None = None,
    images: Mapping[str, tuple[CameraImage, CameraLabels]] | None = None,
) -> Frame:
    """Assemble a frame: reading and labels, with what the spacecraft could know and where the frame comes from."""
    measured = truth.pointing.measured_rad if truth.pointing else None
    sight = lidar.receiver.line_of_sight
    camera = {name: image for name, (image, _) in (images or {}).items()}
    camera_labels = {name: labels_of_image for name, (_, labels_of_image) in (images or {}).items()}
    observation = Observation(truth.time_s, reading, lidar.settings, sight, measured, sensors or {}, camera)
    return Frame(index, observation, labels, truth, scenario.source, kept, camera_labels)


def check_kept(keep: Iterable[str], scenario: Scenario) -> tuple[str, ...]:
    """Check the names of intermediate records to keep and return them; raise `ScenarioError` for an unknown one."""
    if not isinstance(keep, Iterable):
        raise ScenarioError(f"keep: {keep!r:.40} is not a list of names; known: {', '.join(KEPT)}")
    names = (keep,) if isinstance(keep, str) else tuple(keep)
    for name in names:
        if name not in KEPT:
            raise ScenarioError(f"keep: no intermediate record '{name}'; known: {', '.join(KEPT)}")
    traits = scenario.lidar.detector.traits
    for name, is_made in (("waveforms", traits.has_waveforms), ("taps", traits.has_taps)):
        if name in names and not is_made:
            kind = getattr(scenario.lidar.detector, "type", type(scenario.lidar.detector).__name__)
            raise ScenarioError(f'keep: the detector "{kind}" has no {name}; set lidar.detector.type = "gsfl"')
    return names
