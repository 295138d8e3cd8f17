"""A user's own material flies, is refused where it is wrong, and is named in what is written."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar import optics, scene
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Part
from rso_lidar.scene import Crinkled, Lambertian, Phong, RetroReflector, complete
from rso_lidar.study import budget
from tests.optics.bench_for_tests import PAPER_LASER, PAPER_RECEIVER, place, plate, surface, truth_of

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "seams" / "own_material.py"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(EXAMPLE), run_name="example")


@pytest.fixture(scope="module")
def frame(example):
    (frame,) = rl.simulate(example["scenario"], frames=[0], keep=["hits"])
    return frame


def test_the_example_flies(example, frame):
    """The law of Lommel and Seeliger: brightness, BRDF times cosine, is the same all over the lit face."""
    hits = frame.kept["hits"]
    assert len(hits.ray) > 1000
    assert np.ptp(hits.cos_incidence) > 0.9
    square_on = hits.cos_incidence > 1e-3
    brightness = (hits.brdf_per_sr * hits.cos_incidence)[square_on]
    np.testing.assert_allclose(brightness, 0.9 / (8.0 * np.pi), rtol=1e-12)
    assert frame.valid.sum() > 100
    (material,) = set(frame.source.targets[0].materials)
    assert material == f"{example['Dust'].__module__}.Dust(albedo=0.9)"


def test_the_scenario_goes_into_a_recording_and_not_into_a_file(example, tmp_path):
    scenario = example["scenario"]
    with pytest.raises(ScenarioError, match=r"holds the Python object .*Dust\(albedo=0.9\), which TOML cannot; keep"):
        scenario.dumps()
    rl.save(tmp_path / "dust.h5", rl.simulate(scenario, frames=[0]))
    text = rl.open(tmp_path / "dust.h5").source.scenario
    with pytest.raises(
        ScenarioError,
        match=r"target\[0\]\.material: represents the Python object .*Dust.*, which TOML cannot store; set it again",
    ):
        rl.Scenario.loads(text)


def test_scenarios_with_equal_objects_are_equal(example):
    scenario, dust = example["scenario"], example["Dust"]
    stage = scenario.target[0]
    assert scenario == scenario.replace(target=(stage.replace(material=dust(albedo=0.9)),))
    assert scenario != scenario.replace(target=(stage.replace(material=dust(albedo=0.3)),))
    assert scenario != example["clean"].replace(name=scenario.name)


class Own:
    """A part's BRDF, in an object that is no part."""

    def __init__(self, part):
        self.part = part

    def brdf_per_sr(self, cos_in, cos_out, cos_phase):
        assert cos_in.shape == cos_out.shape == cos_phase.shape
        return self.part.brdf_per_sr(cos_in, cos_out, cos_phase)


class Delegating(Own):
    """All that a part says, in an object that is no part."""

    def __getattr__(self, name):
        return getattr(self.part, name)


def hits_of(material, laser_from_m=None):
    turned = place((0.3, 0.2, 40.0), Rotation.from_euler("xyz", (20.0, 30.0, 0.0), degrees=True))
    truth, target = truth_of(target=turned), surface("target", plate(2.0, n=4), material)
    rays = optics.pixel_rays(PAPER_RECEIVER, PAPER_LASER, scene.extent([target], truth))
    return scene.cast(rays, [target], truth, 1, laser_from_m=laser_from_m)


@pytest.mark.parametrize("laser_from_m", [None, (0.5, 0.0, 0.0)])
@pytest.mark.parametrize(
    ("own", "part"),
    [
        (Own, Lambertian(reflectance=0.4)),
        (Own, Phong(diffuse=0.2, specular=0.3, exponent=8.0)),
        (Delegating, Crinkled(diffuse=0.2, specular=0.6, exponent=40.0, tilt_deg=6.0, cell_mm=100.0)),
        (Delegating, RetroReflector(diameter_mm=20.0, reflectance=0.8, fill_fraction=0.5)),
    ],
)
def test_an_object_that_says_what_a_part_says_gives_what_it_gives(own, part, laser_from_m):
    part = part.at(1064e-9)
    hits, same = hits_of(part, laser_from_m), hits_of(own(part), laser_from_m)
    assert len(hits.ray) > 1000
    np.testing.assert_array_equal(same.brdf_per_sr, hits.brdf_per_sr)
    np.testing.assert_array_equal(same.cos_incidence, hits.cos_incidence)


def test_an_object_may_depend_on_the_wavelength():
    class Red(Own):
        def at(self, wavelength_m):
            return Lambertian(reflectance=0.5) if wavelength_m > 1.3e-6 else Own(Lambertian(reflectance=0.1))

    red = complete(Red(Lambertian()))
    assert red.at(1.57e-6) == Lambertian(reflectance=0.5)
    assert red.at(1.06e-6).brdf_per_sr(np.ones(1)) == pytest.approx(0.1 / np.pi)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda cos_in: -1.0 * cos_in, r"Wrong.*: brdf_per_sr returns -0\.\d+; a BRDF is at least 0 and at most"),
        (lambda cos_in: np.nan * cos_in, r"Wrong.*: brdf_per_sr returns nan; a BRDF is at least 0"),
        (
            lambda cos_in: np.ones((len(cos_in), 2)),
            r"shape \(\d+, 2\) for cosines of shape \(\d+,\); return one number",
        ),
    ],
)
def test_an_object_that_answers_nonsense_is_told(answer, message):
    class Wrong:
        def brdf_per_sr(self, cos_in, cos_out, cos_phase):
            return answer(cos_in)

    with pytest.raises(ScenarioError, match=message):
        hits_of(Wrong())


def test_one_number_serves_all_hits():
    class Grey:
        def brdf_per_sr(self, cos_in, cos_out, cos_phase):
            return 0.05

    assert set(hits_of(Grey()).brdf_per_sr) == {0.05}


def test_an_object_may_stand_for_a_part_or_a_colour_of_a_target(example):
    dust = example["Dust"](albedo=0.1)
    stage = example["clean"].target[0].replace(part_materials={"tank": dust})
    (whole,) = example["clean"].replace(target=(stage,)).surfaces
    tank = whole.mesh.part_names.index("tank")
    assert whole.materials[tank].summarize() == f"{dust.__module__}.Dust(albedo=0.1)"
    assert all(isinstance(one, Part) for number, one in enumerate(whole.materials) if number != tank)


def test_a_budget_takes_an_object(example):
    made = budget(example["clean"], materials=[example["Dust"](albedo=0.3)])
    assert any("Dust(albedo=0.3)" in curve.material for curve in made.curves)


class Dull:
    """A material with the members that a test gives it."""

    def brdf_per_sr(self, cos_in, cos_out, cos_phase):
        return 0.1 * cos_in

    def __repr__(self):
        return "Dull()"


@pytest.mark.parametrize(
    ("members", "message"),
    [
        (
            {"brdf_per_sr": lambda self, a, b, c: a * (0.1 + 0.2j)},
            r"brdf_per_sr\(\) returned array.*a real number for each",
        ),
        (
            {"brdf_per_sr": lambda self, a, b, c: a.astype(str)},
            r"brdf_per_sr\(\) returned array.*a real number for each",
        ),
        ({"brdf_per_sr": lambda self, a, b, c: None}, r"brdf_per_sr\(\) returned None; return a real number"),
        (
            {"brdf_per_sr": lambda self, a, b, c: [[1], [1, 2]]},
            r"brdf_per_sr\(\) returned \[\[1\], \[1, 2\]\]; return a real number",
        ),
        ({"brdf_per_sr": lambda self, a, b, c: np.zeros(7)}, r"brdf_per_sr returns an array of shape \(7,\)"),
        ({"mean_brdf_per_sr": lambda self, a, b, c: -a}, r"mean_brdf_per_sr returns -[\d.]+; a BRDF is at least 0"),
        ({"sunlight_brdf_per_sr": lambda self, a, b, c: 1j}, r"sunlight_brdf_per_sr\(\) returned 1j; return a real"),
        (
            {"brdf_per_sr": lambda self, a, b, c: a * 1e300},
            r"brdf_per_sr returns .*; a BRDF is at least 0 and at most 1e\+12",
        ),
        ({"is_retro": "no"}, r"is_retro is 'no'; make it True or False"),
        ({"is_narrow": lambda self: True}, r"is_narrow is a method; make it True or False"),
        ({"lambertian_per_sr": "x"}, r"lambertian_per_sr is 'x'; make it a number"),
        ({"lambertian_per_sr": -0.1}, r"lambertian_per_sr is -0\.1; make it a number from 0 to 1e\+12 or NaN"),
        ({"lambertian_per_sr": np.inf}, r"lambertian_per_sr is inf; make it a number from 0 to 1e\+12 or NaN"),
        ({"rms_slope": None}, r"rms_slope is None; make it a number"),
        ({"rms_slope": np.nan}, r"rms_slope is nan; make it a number from 0"),
        (
            {"tilt_normals": lambda self, normal, point: point},
            r"tilt_normals\(\) returned 5\.0; return numbers of shape",
        ),
        (
            {"average_over_lens": lambda self, peak, *given: -peak},
            r"average_over_lens\(\) returned -1\.0; return numbers",
        ),
        ({"at": lambda self, wavelength_m: None}, r"at\(\) returned None; return a material"),
    ],
)
def test_what_a_member_must_not_be(members, message):
    cosines = np.array([0.2, 0.9])
    with pytest.raises(ScenarioError, match=rf"Dull\(\): {message}") as error:
        material = complete(type("Dull", (Dull,), members)()).at(1064e-9)
        material.brdf_per_sr(cosines)
        material.mean_brdf_per_sr(cosines)
        material.sunlight_brdf_per_sr(cosines, cosines, cosines)
        material.tilt_normals(np.eye(3)[:, :2], np.full((3, 2), 5.0))
        material.average_over_lens(np.ones(2), np.eye(3)[:2], np.ones(2), np.zeros(3), 0.1)
    assert "\n" not in str(error.value)


def test_a_brdf_is_given_read_only_cosines_and_may_return_them():
    class Writing(Dull):
        def brdf_per_sr(self, cos_in, cos_out, cos_phase):
            assert not any(values.flags.writeable for values in (cos_in, cos_out, cos_phase))
            return cos_in

    cosines = np.array([0.2, 0.9])
    found = complete(Writing()).brdf_per_sr(cosines, cosines, np.array([1.0, 0.5]))
    assert found.flags.writeable and cosines.flags.writeable
    np.testing.assert_array_equal(found, cosines)


def test_optional_methods_are_given_read_only_arrays():
    class Structured(Dull):
        lambertian_per_sr = np.nan

        def tilt_normals(self, normal, point):
            assert not normal.flags.writeable and not point.flags.writeable
            return -normal

        def average_over_lens(self, peak_per_sr, direction, range_m, laser_from_m, aperture_m):
            given = (peak_per_sr, direction, range_m, laser_from_m)
            assert not any(values.flags.writeable for values in given)
            return 0.5

    normal, peak_per_sr = np.eye(3)[:, :2], np.ones(2)
    given = (np.eye(3)[:2], np.ones(2), np.zeros(3), 0.1)
    for own, tilted, mean in ((Structured(), -normal, 0.5), (Dull(), normal, 1.0)):
        material = complete(own)
        np.testing.assert_array_equal(material.tilt_normals(normal, np.zeros((3, 2))), tilted)
        np.testing.assert_array_equal(material.average_over_lens(peak_per_sr, *given), [mean, mean])
    assert np.isnan(complete(Structured()).lambertian_per_sr)
    assert normal.flags.writeable and peak_per_sr.flags.writeable


def test_brdfs_of_its_own_for_areas_and_for_sunlight_are_used():
    class Both(Dull):
        def mean_brdf_per_sr(self, cos_in, cos_out, cos_phase):
            return 2.0

        def sunlight_brdf_per_sr(self, cos_in, cos_out, cos_phase):
            return 3.0

    cosines = np.array([0.2, 0.9])
    for own, mean, sunlight in ((Both(), 2.0, 3.0), (Dull(), 0.1 * cosines, 0.1 * cosines)):
        material = complete(own)
        np.testing.assert_allclose(material.brdf_per_sr(cosines), 0.1 * cosines)
        np.testing.assert_allclose(material.mean_brdf_per_sr(cosines), np.broadcast_to(mean, 2))
        np.testing.assert_allclose(
            material.sunlight_brdf_per_sr(cosines, cosines, cosines), np.broadcast_to(sunlight, 2)
        )
