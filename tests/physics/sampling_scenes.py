"""Scenes on which the sampling of pixels is judged, each with the reference that applies to it.

A scene is a function that returns surfaces, truth, receiver and laser. Most come in a random attitude and aligned with the
axes, where the edges of facets run along rows of rays. The laser is a thousand times the paper's: the sampler may leave a
third of a pixel's photon noise, which excuses no error here.
"""

import functools
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar import optics, sampling
from rso_lidar.optics import BrownConrady, Laser, Receiver
from rso_lidar.records import Truth
from rso_lidar.scene import Crinkled, build_surface, load_mesh
from rso_lidar.shapes import Abundance, build_ground
from tests.optics.bench_for_tests import box, place, plate, surface, truth_of
from tests.reference.optics.exact_light import exact_photons, facets_in_lidar_axes, find_touched, lattice_photons

EXACT, LATTICE = "exact", "lattice 16384"
FINE_LATTICE = "lattice 65536"  # for few pixels with fine detail, whose errors average less
MOST_PIXELS = {LATTICE: 512, FINE_LATTICE: 64}  # with a reference: so many tell the rms error of a pixel well enough
SAMPLING_ERRORS = (0.01, 0.02, 0.05)
LASER = Laser(energy_mj=5e4)
RECEIVER = Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32)  # a pixel is 1.36 m wide at 1 km
CRAFT_RECEIVER = Receiver(fov_deg=2.5, f_number=2.8)
CRAFT = {  # range [m]
    "tdrs": 300,
    "cassini": 420,
    "lro": 590,
    "messenger": 700,
    "juno": 820,
    "hubble": 1150,
    "kepler": 1600,
    "voyager": 1900,
    "suomi_npp": 2250,
    "rosetta": 3000,
}
ALIGNED = Rotation.identity()


class Scene(NamedTuple):
    """What is seen, by what: surfaces, truth, receiver and laser."""

    surfaces: list[Any]
    truth: Truth
    receiver: Receiver
    laser: Laser


@dataclass(frozen=True, eq=False)
class SceneCase:
    """A scene by name: the function that builds it, its arguments, and the reference that applies."""

    function: Any
    arguments: tuple[Any, ...]
    reference: str

    def build(self):
        """Return surfaces, truth, receiver and laser."""
        return self.function(*self.arguments)


def one_target(triangles, rotation, range_m, material=None, across_m=(0.0, 0.0), receiver=RECEIVER, laser=LASER):
    """Return the scene of one target."""
    pose = place((*across_m, range_m), rotation)
    return Scene([surface("target", triangles, material)], truth_of(target=pose), receiver, laser)


def plate_edge(rotation):
    """Return a plate of 9 pixels that stands askew to the pixels."""
    return one_target(plate(12.7), rotation, 1000.0, across_m=(0.31, 0.22))


def grating(rotation, width_m=20.0, height_m=16.0):
    """Return booms of 1/27 pixel, at a distance of 0.27 pixels from each other."""
    places_m = np.arange(-0.5 * height_m, 0.5 * height_m, 0.37)
    booms = [box(width_m, 0.05, 0.05) + np.array([0.0, y, 0.0]) for y in places_m]
    return one_target(np.concatenate(booms), rotation, 1000.0)


def body_on_four_pixels(rotation):
    """Return a body smaller than a pixel, over a corner of pixels."""
    return one_target(box(1.3, 1.1, 1.2), rotation, 1000.0, across_m=(0.1, 0.2))


def speck(rotation):
    """Return a body of 1/12 pixel, inside one."""
    return one_target(box(0.34, 0.1, 0.1), rotation, 3000.0, across_m=(1.9, 2.3))


def foil(range_m, cell_mm):
    """Return a body in foil, whose cells glitter: some pixels see four cells across, or twenty."""
    material = Crinkled(diffuse=0.15, specular=0.65, exponent=30.0, tilt_deg=7.0, cell_mm=cell_mm)
    return one_target(box(range_m / 60.0, range_m / 90.0, 2.0), Rotation.random(random_state=6), range_m, material)


@functools.cache
def crater_triangles():
    """Return the triangles (facet, corner, xyz) of cratered ground, 80 m wide, without boulders."""
    heights = build_ground(3, 80.0, 0.625, Abundance(3.0, 20.0, 0.5), Abundance(0.5, 1.0, 0.0)).heights_m
    axis = np.linspace(-40.0, 40.0, len(heights))
    x, y = np.meshgrid(axis, axis, indexing="ij")
    points = np.stack([x, y, -heights], axis=-1)  # up is toward the lidar
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=2).reshape(-1, 3, 3)


def crater_field(rotation):
    """Return cratered ground of 23 pixels, whole in the field of view."""
    return one_target(crater_triangles(), rotation, 2500.0)


def half_hidden(rotation, other):
    """Return a box in front of a larger one, and half over its edge."""
    poses = {"near": place((0.9, 0.4, 600.0), rotation), "far": place((0.0, 0.0, 640.0), other)}
    return Scene(
        [surface("near", box(3.0, 2.0, 2.0)), surface("far", box(6.0, 4.0, 1.0))], truth_of(**poses), RECEIVER, LASER
    )


def interpenetrating(rotation, other):
    """Return two boxes, each of which stands partly inside the other."""
    poses = {"first": place((0.3, 0.2, 800.0), rotation), "second": place((-0.5, 0.1, 800.4), other)}
    return Scene(
        [surface("first", box(6.0, 3.0, 3.0)), surface("second", box(2.5, 7.0, 2.5))],
        truth_of(**poses),
        RECEIVER,
        LASER,
    )


def narrow_beam(footprint):
    """Return an oblique wall in a beam that is a little under four pixels wide."""
    laser = LASER.replace(divergence_deg=0.31, footprint=footprint, energy_mj=500.0)
    return one_target(plate(30.0), Rotation.from_euler("xyz", [10.0, 20.0, 5.0], degrees=True), 1000.0, laser=laser)


def boom_and_speck(rotation, other, receiver):
    """Return a body with a boom through the whole image, and a small one farther off."""
    boom = np.concatenate([box(3.0, 2.0, 2.0), box(0.02, 30.0, 0.02)])
    poses = {"near": place((1.0, 0.0, 900.0), rotation), "small": place((-14.0, 3.0, 1500.0), other)}
    return Scene([surface("near", boom), surface("small", box(0.3, 0.3, 0.3))], truth_of(**poses), receiver, LASER)


def laser_beside_lens(rotation):
    """Return a body with a mast that casts a shadow on it, because the laser is 4 m beside the lens."""
    body = np.concatenate([box(6.0, 4.0, 1.0), box(0.3, 0.3, 8.0)])
    return one_target(body, rotation, 300.0, laser=LASER.replace(offset_m=(4.0, 0.0, 0.0)))


def several_targets(rotations):
    """Return five targets from 400 m to 2.5 km, one of them partly behind another."""
    triangles = [box(2.0, 1.0, 1.0), plate(3.0, 8.0), box(0.5, 0.4, 0.3), box(9.0, 0.3, 4.0), plate(1.0)]
    places = [(-3.0, 2.0, 400.0), (-5.0, 3.0, 550.0), (4.0, -5.0, 700.0), (15.0, 9.0, 1400.0), (-21.0, -30.0, 2500.0)]
    names = [f"target{k}" for k in range(len(places))]
    poses = {name: place(at, turn) for name, at, turn in zip(names, places, rotations, strict=True)}
    surfaces = [surface(name, facets) for name, facets in zip(names, triangles, strict=True)]
    return Scene(surfaces, truth_of(**poses), RECEIVER, LASER)


def craft(shared, name, rotation):
    """Return a spacecraft at its range."""
    mesh = load_mesh(shared / "meshes" / f"{name}.stl")
    poses = truth_of(**{name: place((0.0, 0.0, CRAFT[name]), rotation)})
    return Scene([build_surface(name, mesh)], poses, CRAFT_RECEIVER, LASER)


def _draw(seed, number=None):
    """Return an attitude drawn at random, or a number of them."""
    return Rotation.random(number, random_state=seed)


_BENT = RECEIVER.replace(distortion=BrownConrady(k1=3.0))
_QUARTER = Rotation.from_euler("z", 90, degrees=True)

SCENES = {
    "plate edge, aligned": SceneCase(plate_edge, (ALIGNED,), EXACT),
    "plate edge, random": SceneCase(plate_edge, (_draw(5),), EXACT),
    "plate edge, grazing": SceneCase(plate_edge, (_draw(3),), EXACT),
    "grating, along rows": SceneCase(grating, (ALIGNED,), EXACT),
    "grating, along columns": SceneCase(grating, (_QUARTER,), EXACT),
    "grating, random": SceneCase(grating, (_draw(4),), EXACT),
    "four pixels, aligned": SceneCase(body_on_four_pixels, (ALIGNED,), EXACT),
    "four pixels, random": SceneCase(body_on_four_pixels, (_draw(10),), EXACT),
    "speck, aligned": SceneCase(speck, (ALIGNED,), EXACT),
    "speck, random": SceneCase(speck, (_draw(9),), EXACT),
    "half hidden, aligned": SceneCase(half_hidden, (ALIGNED, ALIGNED), EXACT),
    "half hidden, random": SceneCase(half_hidden, (_draw(1), _draw(2)), EXACT),
    "interpenetrating, aligned": SceneCase(interpenetrating, (ALIGNED, ALIGNED), EXACT),
    "interpenetrating, random": SceneCase(interpenetrating, (_draw(11), _draw(12)), EXACT),
    "several targets, aligned": SceneCase(several_targets, ([ALIGNED] * 5,), EXACT),
    "several targets, random": SceneCase(several_targets, (list(_draw(13, 5)),), EXACT),
    "boom and speck, aligned": SceneCase(boom_and_speck, (ALIGNED, ALIGNED, RECEIVER), EXACT),
    "boom and speck, random": SceneCase(boom_and_speck, (_draw(7), _draw(8), RECEIVER), EXACT),
    "narrow beam, square": SceneCase(narrow_beam, ("square",), EXACT),
    "narrow beam, circle": SceneCase(narrow_beam, ("circle",), EXACT),
    "narrow beam, gaussian": SceneCase(narrow_beam, ("gaussian",), EXACT),
    "distorted lens, aligned": SceneCase(boom_and_speck, (ALIGNED, ALIGNED, _BENT), FINE_LATTICE),
    "distorted lens, random": SceneCase(boom_and_speck, (_draw(7), _draw(8), _BENT), FINE_LATTICE),
    "laser beside the lens": SceneCase(laser_beside_lens, (_draw(14),), LATTICE),
    "foil, near": SceneCase(foil, (300.0, 50.0), FINE_LATTICE),
    "foil, far": SceneCase(foil, (3000.0, 200.0), FINE_LATTICE),
    "crater field, aligned": SceneCase(crater_field, (ALIGNED,), LATTICE),
    "crater field, oblique": SceneCase(crater_field, (Rotation.from_euler("xz", [50, 20], degrees=True),), LATTICE),
}
ATTITUDES = ("random", "aligned")


@functools.cache
def craft_case(shared, name, attitude):
    """Return the case of a spacecraft in an attitude of `ATTITUDES`."""
    rotation = ALIGNED if attitude == "aligned" else _draw(CRAFT[name])
    return SceneCase(craft, (shared, name, rotation), LATTICE if CRAFT[name] < 1500 else FINE_LATTICE)


def rays_of(case):
    """Return the number of rays in each pixel of a case whose reference is a lattice."""
    return int(case.reference.removeprefix("lattice "))


def draw_pixels(pixels, most):
    """Return all of some pixels, or as many as allowed, drawn at random and in order."""
    if len(pixels) <= most:
        return pixels
    return np.sort(np.random.default_rng(29).choice(pixels, most, replace=False))


def true_photons(case, scene):
    """Return the photons (pixel) of a scene by the reference that applies; NaN in the pixels that a lattice leaves out."""
    touched = find_touched(scene.surfaces, scene.truth, scene.receiver)
    if case.reference != EXACT:
        drawn = draw_pixels(touched, MOST_PIXELS[case.reference])
        photons = lattice_photons(*scene, rays_of(case), pixels=drawn)
        photons[np.setdiff1d(touched, drawn)] = np.nan
        return photons
    photons = exact_photons(*facets_in_lidar_axes(scene.surfaces, scene.truth), scene.receiver, scene.laser, touched)
    return np.nan_to_num(photons, nan=0.0)


def compare(got, true, variance):
    """Compare the photons of pixels with the true ones.

    Parameters
    ----------
    got, true : (pixel) photons; a pixel whose true ones are NaN is left out
    variance : (pixel) of `got`, as its label says

    Returns
    -------
    The relative rms error of a pixel weighted by light, the same as the label says, and the relative error of the total.
    A pixel dimmer than a thousandth of the brightest weighs as one of a thousandth.
    """
    known = np.isfinite(true)
    got, true, variance = got[known], true[known], variance[known]
    weight = np.maximum(true, true.max() / 1000.0)
    total = true.sum()
    error, label = (math.sqrt((squares / weight).sum() / total) for squares in ((got - true) ** 2, variance))
    return error, label, got.sum() / total - 1.0


@functools.cache
def load_case(case):
    """Return the scene of a case, and its true photons (pixel), once a session."""
    scene = case.build()
    photons = true_photons(case, scene)
    photons.flags.writeable = False
    return scene, photons


def sample(scene, sampling_error):
    """Return the photons (pixel) of a scene as the sampler finds them, and their variance as it says."""
    surfaces, truth, receiver, laser = scene
    receiver = receiver.replace(sampling_error=sampling_error)
    hits = sampling.cast_pixels(receiver, laser, surfaces, truth)
    photons = np.bincount(
        hits.pixel, optics.pixel_photons(hits, laser, receiver) * hits.weight, math.prod(receiver.shape)
    )
    return photons, hits.photons_variance.ravel()


def print_table(cases):
    """Print error, label and error of the total [%] of cases by name, for three errors that are asked for."""
    print(
        f"{'scene':28} {'reference':13} {'lit':>5}"
        + "".join(f"   {f'asked {error:.0%}: error label   total':>34}" for error in SAMPLING_ERRORS)
    )
    for name, case in cases.items():
        scene, true = load_case(case)
        figures = [
            compare(got, true, variance) for got, variance in (sample(scene, error) for error in SAMPLING_ERRORS)
        ]
        row = "".join(f"   {error:24.2%} {label:6.2%} {total:+8.3%}"[-37:] for error, label, total in figures)
        print(f"{name:28} {case.reference:13} {np.count_nonzero(true > 0.0):5}{row}", flush=True)


if __name__ == "__main__":  # python -m tests.physics.sampling_scenes, and the folder of real data for the spacecraft
    print_table(SCENES)
    for folder in sys.argv[1:]:
        print_table({f"{name}, {turn}": craft_case(Path(folder), name, turn) for name in CRAFT for turn in ATTITUDES})
