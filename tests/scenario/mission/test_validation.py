"""What a bad scenario gets: one line that names file, place, what is wrong and what to do."""

from pathlib import Path

import pytest

import rso_lidar as rl
from rso_lidar.errors import FieldError, RsoLidarError, ScenarioError, SettingError, add_place
from rso_lidar.shipped import shipped

ORBIT = (
    'motion = { type = "kepler", epoch_utc = 2024-09-17T12:00:00Z, semi_major_axis_km = 7000, eccentricity = 0.001, '
    "inclination_deg = 98, raan_deg = 10, argument_of_perigee_deg = 20, true_anomaly_deg = 30 }"
)

# (what is written instead of what, words that the line must hold)
BAD = {
    "unknown key, with a guess": ("natural_hz", "natural_freq_hz", ["ptu.response", "natural_freq_hz", "'natural_hz'"]),
    "unknown table": ("[ptu]", "[gimbal]", ["unknown key 'gimbal'"]),
    "text for a number": ("energy_mj = 50", 'energy_mj = "50 mJ"', ["lidar.laser.energy_mj", "number", "'50 mJ'"]),
    "bool for a number": ("energy_mj = 50", "energy_mj = true", ["lidar.laser.energy_mj", "number"]),
    "negative energy": ("energy_mj = 50", "energy_mj = -50", ["lidar.laser.energy_mj", "greater than 0", "-50"]),
    "NaN": ("energy_mj = 50", "energy_mj = nan", ["lidar.laser.energy_mj", "finite"]),
    "field of view over 180": ("fov_deg  = 2.5", "fov_deg = 181", ["lidar.receiver.fov_deg", "less than 180"]),
    "field of view twice": ("fov_deg  = 2.5", "fov_deg = 2.5\nfocal_length_mm = 9", ["exactly one", "focal_length_mm"]),
    "no aperture": ("f_number = 2.8", "", ["exactly one", "aperture_mm"]),
    "no rays": ("rays_per_pixel = 4", "rays_per_pixel = 0", ["rays_per_pixel", "1"]),
    "rays that are no square": ("rays_per_pixel = 4", "rays_per_pixel = 5", ["rays_per_pixel", "4 instead of 5"]),
    "time without an offset": ("12:00:00Z", "12:00:00", ["time.start_utc", "offset", "Z"]),
    "time as a text": ("2024-09-17T12:00:00Z", '"2024-09-17T12:00:00Z"', ["time.start_utc", "without quotes"]),
    "no frames": ("duration_s    = 2", "duration_s = 0.01", ["duration_s * frame_rate_hz", "no frame"]),
    "too many frames": ("duration_s    = 2", "duration_s = 1e12", ["split the run"]),
    "a version to come": ("version = 1", "version = 2", ["version", "up to 1", "upgrade rso_lidar"]),
    "broken TOML": ("version = 1", "version = = 1", ["not valid TOML", "line 2"]),
    "an unknown detector": ("[lidar.laser]", '[lidar.detector]\ntype = "gsfi"\n[lidar.laser]', ["'gsfi'", "empirical"]),
    "unknown motion": ('"fixed", position_m = [1000', '"fixd", position_m = [1000', ["'fixd'", "'fixed'"]),
    "motion without type": (
        'type = "fixed", position_m = [0, 0, 0]',
        "position_m = [0, 0, 0]",
        ["follower.motion", "type"],
    ),
    "vector too short": ("[1000, 0, 0]", "[1000, 0]", ["target[0].motion.position_m[2]", "missing"]),
    "axis of no length": ("axis = [0, 0, 1]", "axis = [0, 0, 0]", ["target[0].attitude.axis", "zero vector"]),
    "bare lvlh": (
        '{ type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }',
        '{ type = "lvlh" }',
        ["target[0].attitude", "rtn", "lvlh_ccsds"],
    ),
    "reflectance over 1": ("reflectance = 0.30", "reflectance = 1.3", ["target[0].material.reflectance", "1.3"]),
    "material that makes light": (
        '{ type = "lambertian", reflectance = 0.30 }',
        '{ type = "phong", diffuse = 0.6, specular = 0.6, exponent = 10 }',
        ["target[0].material", "diffuse + specular"],
    ),
    "reserved name": ('name     = "plate"', 'name = "lidar"', ["lidar", "reserved"]),
    "name of nothing": ('at = "plate"', 'at = "plaet"', ["ptu.point.at", "'plaet'", "'plate'"]),
    "orbit without an Earth": (
        'motion = { type = "fixed", position_m = [0, 0, 0] }',
        ORBIT,
        ["follower.motion", "local"],
    ),
    "relative to nothing": (
        "position_m = [0, 0, 0] }",
        'position_m = [0, 0, 0], relative_to = "plat" }',
        ["follower.motion.relative_to", "'plat'", "'plate'"],
    ),
    "relative to itself": (
        "position_m = [0, 0, 0] }",
        'position_m = [0, 0, 0], relative_to = "follower" }',
        ["loop", "follower"],
    ),
    "one table for a list": ("[[target]]", "[target]", ["target", "[[...]]"]),
    "a number of no world": ("[1000, 0, 0]", "[1e300, 0, 0]", ["target[0].motion.position_m[0]", "1e+300", "unit"]),
    "an angle of nothing": ("fov_deg  = 2.5", "fov_deg = 1e-300", ["lidar.receiver.fov_deg", "1e-300"]),
    "a year of no flight": ("2024-09-17T12:00:00Z", "0001-01-01T00:00:00+14:00", ["time.start_utc", "1900"]),
    "a version that is no number": ("version = 1", 'version = "1"', ["version", "'1'", "known: 1"]),
    "brackets without end": ("version = 1", "version = " + "[" * 5000, ["levels deep"]),
    "a number without end": ("seed    = 7", "seed = 1" + "0" * 5000, ["TOML"]),
    "too many in a vector": ("[1000, 0, 0]", "[1000, 0, 0, 0]", ["3 entries"]),
    "a key of another's naming": (
        '{ type = "lambertian", reflectance = 0.30 }',
        '{ type = "phong", diffuse = 0.1, specular = 0.1, exponent = 10, k_d = 1 }',
        ["target[0].material", "'k_d'", "diffuse"],
    ),
    "scale and size": ('model    = "plate"', 'model = "plate"\nscale = 2.0\nsize_m = 3.0', ["scale or size_m"]),
}


@pytest.mark.parametrize("case", BAD)
def test_one_line_with_place_and_cure(case, text):
    old, new, words = BAD[case]
    assert old in text
    with pytest.raises(ScenarioError) as error:
        rl.Scenario.loads(text.replace(old, new), where="bench.toml")
    line = str(error.value)
    assert line.startswith("bench.toml: ")
    assert "\n" not in line
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('model    = "plate"', 'model = "plat"', ["target plate", "unknown model 'plat'", "'plate'"]),
        ('model    = "plate"', 'model = "meshes/plate.stl"', ["target plate", "no file 'meshes/plate.stl'"]),
        ('model    = "plate"', 'model = "plate.step"', ["target plate", "plate.step"]),
        ('model    = "plate"', 'model = "~nobody-of-that-name/x.stl"', ["target plate", "no file"]),
        ('model    = "plate"', 'model = "' + "x" * 300 + '.stl"', ["target plate", "no file"]),
        ('model    = "plate"', 'model = "plate"\nsize_m = 1e11', ["target plate", "plate.glb", "size_m"]),
        (
            "material = {",
            'part_materials = { wing = { type = "lambertian" } }\nmaterial = {',
            ["target plate", "part_materials", "'wing'"],
        ),
    ],
)
def test_what_only_files_can_tell(old, new, words, text):
    scenario = rl.Scenario.loads(text.replace(old, new), where="bench.toml")
    with pytest.raises(RsoLidarError) as error:
        _ = scenario.surfaces
    assert all(word in str(error.value) for word in ["bench.toml", *words])


def test_a_material_that_a_camera_s_band_lacks_is_refused_before_the_flight(text):
    """What is given at 1064 nm alone has no colour; the line names camera, band and part."""
    old = 'material = { type = "lambertian", reflectance = 0.30 }'
    assert old in text
    cells = '{ type = "by_wavelength", wavelength_nm = [1064], materials = [{ type = "lambertian" }] }'
    camera = '[[camera]]\nname = "nav"\nbands = "rgb"\nlens = { fov_deg = 4, f_number = 4 }\n[lidar.laser]'
    scenario = rl.Scenario.loads(
        text.replace(old, f"material = {cells}").replace("[lidar.laser]", camera), where="bench.toml"
    )
    says = (
        r"^bench.toml: camera nav, band red: target plate: material: by_wavelength: no material .* 625 nm .*; add one"
    )
    for act in (scenario.describe, lambda: list(rl.simulate(scenario))):
        with pytest.raises(ScenarioError, match=says):
            act()


@pytest.mark.parametrize("name", ["lidar", "ptu", "inertial", "follower", "sun_direction"])
def test_reserved_names_of_axes(name, text):
    with pytest.raises(ScenarioError, match="reserved"):
        rl.Scenario.loads(text.replace('model    = "plate"', f'model = "plate"\naxes = [{{ name = "{name}" }}]'))


def test_what_only_motion_can_tell_names_file_and_body(text):
    up = '{ type = "look_at", at = "follower", up = [1, 0, 0] }'
    scenario = rl.Scenario.loads(
        text.replace('{ type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }', up), where="bench.toml"
    )
    for act in (lambda: list(rl.simulate(scenario)), scenario.describe):
        with pytest.raises(ScenarioError, match=r"^bench\.toml: plate\.attitude: .*up"):
            act()


def test_two_bodies_with_one_name(text):
    twin = text[text.index("[[target]]") : text.index("[follower]")]
    with pytest.raises(ScenarioError, match="plate: two bodies or axes have this name"):
        rl.Scenario.loads(text.replace("[follower]", twin + "[follower]"))


def test_a_loop_of_looks_is_none_but_of_places_is(text):
    mutual = text.replace(
        '{ type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }', '{ type = "look_at", at = "follower" }'
    )
    mutual = mutual.replace("[follower]\n", '[follower]\nattitude = { type = "look_at", at = "plate" }\n')
    assert rl.Scenario.loads(mutual).bodies  # each looks at the other's place, which does not turn
    loop = text.replace("[1000, 0, 0]", '[1000, 0, 0], relative_to = "follower"').replace(
        "position_m = [0, 0, 0]", 'position_m = [0, 0, 0], relative_to = "plate"'
    )
    with pytest.raises(ScenarioError, match=r"loop \((plate -> follower|follower -> plate)"):
        rl.Scenario.loads(loop)


def test_files_that_are_none(tmp_path):
    for path, words in [
        (tmp_path / "none.toml", "no such file"),
        (tmp_path, "is a folder"),
    ]:
        with pytest.raises(ScenarioError, match=words):
            rl.Scenario.load(path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(bytes(range(128, 256)))
    with pytest.raises(ScenarioError, match="not UTF-8"):
        rl.Scenario.load(binary)


class TestSettings:
    def test_a_number(self, text):
        assert rl.Scenario.loads(text, settings=("lidar.laser.energy_mj=20",)).lidar.laser.energy_mj == 20

    def test_a_bare_word_and_a_place_by_name_or_number(self, text):
        assert rl.Scenario.loads(text, settings=("target.plate.model=sphere",)).target[0].model == "sphere"
        assert rl.Scenario.loads(text, settings=('target.0.model="sphere"',)).target[0].model == "sphere"

    def test_a_table_that_was_not_there(self, text):
        scenario = rl.Scenario.loads(text, settings=("lidar.detector.armed_to_m=9000",))
        assert scenario.lidar.detector.armed_to_m == 9000

    @pytest.mark.parametrize(
        ("setting", "words"),
        [
            ("nonsense", "place=value"),
            ("lidar.laser.energy=3", "did you mean 'energy_mj'"),
            ("target.3.model=x", "no entry '3'"),
            ("target.disc.model=x", "no entry 'disc'"),
            ("seed.deep=3", "is a value, not a table"),
            ("lidar.laser.energy_mj=abc", "number"),
        ],
    )
    def test_bad_ones(self, setting, words, text):
        with pytest.raises(ScenarioError, match=words):
            rl.Scenario.loads(text, settings=(setting,))


def test_an_error_says_to_a_program_what_was_wrong(text):
    """The place of each field that is wrong and its kind; a setting without a place is of another class."""
    with pytest.raises(FieldError) as caught, add_place("study.toml"):
        rl.Scenario.loads(text, settings=("lidar.laser.energy_mj=-5", 'ptu.response.damping="much"'))
    wrong = {".".join(map(str, place[:2])): kind for place, kind in caught.value.problems}
    assert wrong == {"lidar.laser": "greater_than", "ptu.response": "float_type"}
    with pytest.raises(SettingError, match="no entry 'plane'"):
        rl.Scenario.loads(text, settings=("target.plane.scale=2",))


def test_a_file_that_is_missing_in_the_working_folder_is_said_so(tmp_path, monkeypatch):
    """Not `beside the scenario (.)`."""
    monkeypatch.chdir(tmp_path)
    text = (
        shipped("examples/bench_plate.toml")
        .read_text(encoding="utf-8")
        .replace('model    = "plate"', 'model = "gone.glb"')
    )
    Path("bench.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"no file 'gone\.glb' in the working folder nor among the shipped data"):
        rl.Scenario.load("bench.toml").describe()
