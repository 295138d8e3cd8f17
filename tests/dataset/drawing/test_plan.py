"""The plan of a dataset: samples in random order, classes divided by shares, models and sensors kept apart."""

import hashlib
import json
import pickle

import numpy as np
import pytest
from scipy.stats import chi2_contingency

import rso_lidar as rl
from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.making.make import check_samples, make_shard
from rso_lidar.dataset.specification.tables import SPLITS
from tests.dataset.bench_for_tests import CAMERA, SCENARIO, SPEC, make_spec


def classes(counts, **further):
    """Return classes of a plate with these numbers of samples."""
    return [{"name": name, "models": ["plate"], "samples": count, **further} for name, count in counts.items()]


def test_each_class_has_its_samples_once(tmp_path):
    membership = make_plan(make_spec(tmp_path, classes=classes({"a": 40, "b": 21}))).membership
    for k, count in ((0, 40), (1, 21)):
        assert sorted(membership.number[membership.target_class == k]) == list(range(count))


def test_the_number_of_a_sample_tells_nothing_of_its_class(tmp_path):
    counts = dict.fromkeys("abcdefg", 400)
    plan = make_plan(make_spec(tmp_path, classes=classes(counts), split={"type": "random", "test": 0.4}))
    owner, index = plan.membership.target_class, np.arange(2800)
    for cells in (*(index % n for n in range(2, 15)), index // 100, np.roll(owner, 1)):
        table = np.histogram2d(cells, owner, (int(cells.max()) + 1, 7))[0]
        assert chi2_contingency(table).pvalue > 1e-5  # a false alarm in 1 of 7,000 seeds, and the seed is fixed
    assert (np.bincount(owner) == 400).all()
    other = make_plan(make_spec(tmp_path, classes=classes(counts), seed=12)).membership.target_class
    assert 280 < (owner == other).sum() < 520  # 400 expected of independent orders, 6 sigma


def test_a_set_that_grows_moves_no_sample(tmp_path):
    small = make_plan(make_spec(tmp_path, classes=classes({"a": 40, "b": 40}))).membership
    large = make_plan(make_spec(tmp_path, classes=classes({"a": 55, "b": 200}))).membership
    for k in (0, 1):
        before = dict(zip(small.number[small.target_class == k], small.split[small.target_class == k], strict=True))
        after = dict(zip(large.number[large.target_class == k], large.split[large.target_class == k], strict=True))
        assert before.items() <= after.items()


def test_a_random_split_divides_each_class_by_its_shares(tmp_path):
    split = {"type": "random", "val": 0.1, "test": 0.4}
    plan = make_plan(make_spec(tmp_path, classes=classes({"a": 3000, "b": 70, "c": 10}), split=split))
    assert plan.count_samples().tolist() == [[1500, 300, 1200], [35, 7, 28], [5, 1, 4]]


def test_no_split_is_empty_where_a_class_has_a_sample_for_each(tmp_path):
    split = {"type": "random", "val": 0.05, "test": 0.1}
    for seed in range(20):
        plan = make_plan(make_spec(tmp_path, classes=classes({"a": 3, "b": 4, "c": 11}), split=split, seed=seed))
        assert (plan.count_samples() >= 1).all()
    said = "split: no sample of class 'b' is in [a-z]+; give it 3 samples or more"
    with pytest.raises(rl.DatasetError, match=said):
        make_plan(make_spec(tmp_path, classes=classes({"a": 3, "b": 2}), split=split))


def test_one_sample_is_placed_without_the_others(tmp_path):
    for counts, split in (
        ({"a": 30, "b": 20, "c": 7}, {"type": "random", "test": 0.3, "val": 0.2}),
        ({"a": 8, "b": 8}, {"type": "model", "test": ["sphere"]}),
    ):
        both = [one | {"models": ["plate", "sphere"]} for one in classes(counts)]
        plan = make_plan(make_spec(tmp_path, classes=both, split=split))
        whole = plan.membership
        placed = [plan.place_sample(index) for index in range(sum(counts.values()))]
        assert [one[0] for one in placed] == whole.target_class.tolist()
        assert [one[1] for one in placed] == whole.number.tolist()
        assert [SPLITS.index(one[2]) for one in placed] == whole.split.tolist()
        firsts = [plan.find_first(k) for k in range(len(counts))]
        assert firsts == [int((whole.target_class == k).argmax()) for k in range(len(counts))]


def test_a_worker_needs_no_list_of_all_samples(tmp_path):
    plan = make_plan(make_spec(tmp_path))
    (tmp_path / "train").mkdir()
    sent = pickle.loads(pickle.dumps(plan))
    make_shard(sent, tmp_path, plan.shard(0))
    assert "membership" not in vars(sent) and (tmp_path / "train" / "000000.h5").is_file()


def test_every_sample_is_in_one_shard(tmp_path):
    plan = make_plan(make_spec(tmp_path))
    places = [plan.shard(number) for number in range(plan.n_shards)]
    assert sorted(np.concatenate([place.samples for place in places])) == list(range(15))
    assert len({place.path for place in places}) == plan.n_shards
    assert all(len(place.samples) <= 3 for place in places)  # 6 frames of a shard, 2 draws of a sample


def test_a_model_is_kept_for_the_test(tmp_path):
    own = [{"name": "round", "models": ["sphere", "capsule"], "samples": 20}]
    plan = make_plan(make_spec(tmp_path, classes=own, split={"type": "model", "test": ["capsule"]}))
    chosen = plan.choose_model(0, plan.membership.number)
    assert 0 < chosen.sum() < 20 and np.array_equal(plan.membership.split == 2, chosen == 1)


def test_a_sensor_is_kept_for_the_test(tmp_path):
    sensors = [{"name": "near"}, {"name": "far", "set": ["lidar.receiver.fov_deg=0.5"]}]
    counts, split = {"a": 20, "b": 20}, {"type": "sensor", "test": ["far"]}
    plan = make_plan(make_spec(tmp_path, classes=classes(counts), sensor=sensors, split=split))
    for k in range(2):
        mine = plan.membership.target_class == k
        assert np.array_equal(
            plan.membership.split[mine] == 2, plan.choose_sensor(k, plan.membership.number[mine]) == 1
        )


@pytest.mark.parametrize("key", ["camera_electrons", "keypoints", "normals"])
def test_labels_that_are_not_asked_for_leave_the_hash(tmp_path, key):
    spec = make_spec(tmp_path)
    before, after = make_plan(spec), make_plan(spec.replace(labels={key: True}))
    own = spec.model_dump(exclude_none=True, exclude={"scenario", "set"})
    own["labels"] = {"prediction": True, "part_visibility": False, "oversampled": False}  # all that there were at first
    text = json.dumps([2, own, before.mesh_sha256, before.tables], sort_keys=True, default=str)
    assert before.sha256 == hashlib.sha256(text.encode()).hexdigest() != after.sha256


@pytest.mark.parametrize(
    ("setting", "error"),
    [
        ("camera[0].lens.n_rows=12", "camera nav: has 12 x 32 x 1 pixels, and with the first sensor 24 x 32 x 1"),
        ('camera[0].bands="rgb"', "camera nav: has 24 x 32 x 3 pixels, and with the first sensor 24 x 32 x 1"),
        ("camera=[]", "camera nav: takes images in some samples and in others not"),
        ('camera[0].name="other"', "camera nav: takes images in some samples and in others not"),
    ],
)
def test_cameras_of_another_sensor_are_refused(tmp_path, setting, error):
    spec = make_spec(tmp_path, set=(CAMERA,), sensor=[{"name": "near"}, {"name": "far", "set": [setting]}])
    with pytest.raises(rl.DatasetError, match=error):
        check_samples(make_plan(spec))


@pytest.mark.parametrize("key", ["keypoint_file=points.csv", "facet_parts.file=parts.csv", "keypoint=[]"])
def test_parts_and_keypoints_do_not_differ_from_class_to_class(tmp_path, key):
    one = [{"name": "own", "samples": 4, "set": [f"target.0.{key}"]}]
    name = key.split("=")[0].split(".")[0]
    with pytest.raises(rl.DatasetError, match=f"classes: own: set: {name} cannot differ"):
        make_plan(make_spec(tmp_path, classes=one))


def test_models_by_taxonomy(tmp_path):
    own = [{"name": "cubesats", "taxonomy": {"subclass": "cubesat"}, "samples": 20}]
    assert make_plan(make_spec(tmp_path, classes=own)).models == (
        "cubesat_12u",
        "cubesat_1u",
        "cubesat_3u",
        "cubesat_6u",
    )


def test_the_hash_covers_every_file_that_is_named(tmp_path):
    motion = 'motion = { type = "table", file = "path.csv" }'
    bench = SCENARIO.replace('motion = { type = "fixed", position_m = [300, 0, 0] }', motion)
    row = "0, 300, 0, 0, 0, 0, 0, 1\n2, 300, 0, 0, 0, 0, 0, 1\n"
    named = ("path.csv", "psf.csv", "drawn.csv", "law.py")
    for name in named:
        (tmp_path / name).write_text(row, encoding="utf-8")
    classes = [{"name": "own", "samples": 4, "set": ['lidar.receiver.psf={type="measured",file="psf.csv"}']}]
    laws = ["drawn.csv", {"type": "user", "dynamics": "law.py:fall"}]
    variable = [{"field": "target.body.motion", "law": {"type": "choice", "values": laws}}]
    spec = make_spec(tmp_path, classes=classes, variable=variable)
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    plan = make_plan(spec)
    assert set(plan.file_sha256) == set(named)
    hashes = {plan.sha256}
    for name in named:
        (tmp_path / name).write_text(row.replace("300", "301"), encoding="utf-8")
        hashes.add(make_plan(spec).sha256)
    assert len(hashes) == 1 + len(named)


@pytest.mark.parametrize(
    ("changed", "to", "said"),
    [
        ("bench.toml", "other.toml", "no file 'other.toml'"),
        ('models = ["plate"]', 'models = ["plait"]', "plait"),
        ('models = ["plate"]', 'models = ["plate"], empty = true', "leave out all but one"),
        ('models = ["plate"]', 'taxonomy = { subclass = "dragon" }', "no shipped model"),
        ('models = ["plate"]', "taxonomy = {}", "gives no key"),
        (
            'models = ["plate"]',
            'fragments = { characteristic_length_m = { type = "uniform", low = 1, high = 20 } }',
            r"characteristic_length_m: draws 1 to 20 m, and fragments are of 0\.001 to 10 m",
        ),
        (
            'models = ["plate"]',
            'fragments = { characteristic_length_m = { type = "so3" } }',
            r"classes\[0\]\.fragments\.characteristic_length_m",
        ),
        (
            'models = ["plate"]',
            'models = ["plate"], fragments = { characteristic_length_m = { type = "uniform", low = 1, high = 2 } }',
            "gives models and fragments; leave out all but one",
        ),
        ("samples = 6", "samples = 0", "samples"),
        ("samples = 3", "samples = 1", "no sample of class 'empty' is in"),
        ('name = "round"', 'name = "plate"', "rename one"),
        ("test = 0.4", "test = 1.0", "nothing is left to train on"),
        ('"random", test = 0.4', '"model", test = ["sphere"]', "no model to split by"),
        ('"random", test = 0.4', '"sensor", test = ["far"]', "no sensor 'far'"),
        (
            'type = "random", test = 0.4 }',
            'type = "sensor", test = ["d"] }\nsensor = [{ name = "a" }, { name = "b" }, { name = "c" }, { name = "d" }]',
            "no sample of class '[a-z]+' is in",
        ),
        ("lidar.laser.energy_mj", "seed", "variable seed: is overwritten"),
        (
            'models = ["plate"], samples = 6',
            'samples = 6, set = ["target=[]"]',
            "removes the target that classes replace",
        ),
        ('models = ["plate"], samples = 6', 'samples = 6, set = ["target=[3]"]', "replaces the list of targets"),
        ('models = ["plate"], samples = 6', 'samples = 6, set = ["lidar.receiver.n_cols=8"]', "has 16 x 8 pixels"),
        ("lidar.laser.energy_mj", "target.body.motion.position_m.0", "no entry 'body'|is overwritten"),
        (
            'variable = [{ field = "lidar.laser.energy_mj", law = { type = "uniform", low = 10, high = 60 } }]',
            'variable = [{ field = "target.0.model", law = { type = "choice", values = ["sphere"] }, classes = ["plate"] }]',
            "makes the target 'sphere', not 'plate'; name it in models",
        ),
        (
            "variable = [",
            'variable = [{ field = "lidar.laser.energy_mj", law = { type = "uniform", low = 1, high = 2 } }, ',
            "energy_mj: is drawn twice",
        ),
        ('"log_uniform", low = 50', '"uniform", low = -50', "draws -50 m, and a range is above 0"),
        (
            '"log_uniform", low = 50, high = 400',
            '"choice", values = [50, nan]',
            "draws nan, and the field needs a number",
        ),
        ("low = 50", "low = nan", r"view\.range_m\.low: should be a finite number"),
        ("lidar.laser.energy_mj", "lidar.laser.energie", "energie"),
        ("seed = 11", 'seed = 11\ntarget = "bodie"', "did you mean 'body'"),
        ("seed = 11", 'seed = 11\nset = ["target.1.model=plate"]', "no entry '1'"),
        ("seed = 11", "seed = 11\nsequence = { frames = 11 }", "more than the 10 of the scenario"),
        ("seed = 11", 'seed = 11\nset = ["ptu.point.type=fixed"]', "ptu"),
        ("seed = 11", "seed = 11\nclutter = { count = { type = 'whole', low = 1, high = 2 } }", "neither models nor"),
        (
            "seed = 11",
            "seed = 11\nclutter = { models = ['plate'], count = { type = 'whole', low = 1, high = 99 } }",
            "16",
        ),
    ],
)
def test_bad_specifications_say_where(tmp_path, changed, to, said):
    assert changed in SPEC
    with pytest.raises((rl.ScenarioError, rl.DatasetError, rl.MeshError), match=said) as caught:
        rl.dataset.make(make_spec(tmp_path, SPEC.replace(changed, to, 1)), tmp_path / "out", workers=1)
    assert "\n" not in str(caught.value) and str(caught.value).startswith("spec.toml")
    assert not (tmp_path / "out").exists()
