"""The ROS 2 node: its bytes, made with rosbags, are read by mcap_ros2. The node itself needs ROS and is only compiled."""

import ast
import importlib.util
import json
import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.export import to_stamp_ns
from rso_lidar.export.formats.mcap import RosStream
from tests.settings_for_tests import limit_pixels

pytest.importorskip("rosbags.typesys", reason="needs rosbags: pip install rosbags")
mcap = pytest.importorskip("mcap_ros2.decoder", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
PACKAGE = EXAMPLES / "bridges" / "ros2" / "rso_lidar_ros"
MESSAGES = EXAMPLES / "bridges" / "ros2" / "rso_lidar_msgs"
FOLDER = PACKAGE / "rso_lidar_ros"
SMALL = (
    "time.duration_s=2",
    *limit_pixels(16, 1),
)
CLOCK = "builtin_interfaces/Time clock\n" + "=" * 80 + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"


@pytest.fixture(scope="module")
def example():
    return SimpleNamespace(**runpy.run_path(str(FOLDER / "messages.py"), run_name="example"))


@pytest.fixture(scope="module")
def scenario():
    """Four flashes at a tumbling stage from a craft with a PTU, a gyro and an accelerometer of one unit, and GNSS."""
    whole = rl.Scenario.load(EXAMPLES / "flight_software" / "tumbling_stage.toml", settings=SMALL)
    imu = rl.sensors.Gyro(name="imu", rate_hz=20.0), rl.sensors.Accelerometer(name="force", rate_hz=20.0)
    return whole.replace(sensor=(*imu, rl.sensors.Gnss(name="gnss", rate_hz=1.0)))


@pytest.fixture(scope="module")
def flown(example, scenario):
    """The messages of each step of 0.1 s; the PTU is commanded after the first flash."""
    lidar = example.SteppedLidar(scenario, 0.1)
    steps = [lidar.step()]
    lidar.point({"tilt": 0.01})
    lidar.point({"pan": 0.775})
    while not lidar.is_over:
        steps.append(lidar.step())
    return steps


@pytest.fixture(scope="module")
def decode(scenario):
    """Return a function that reads CDR with mcap_ros2, by the definitions of our MCAP files."""
    stream = RosStream(next(iter(rl.simulate(scenario, frames=[0]))))
    texts = stream.definitions | {"rosgraph_msgs/msg/Clock": CLOCK}
    made = {}

    def read(kind, data):
        if kind not in made:
            schema = SimpleNamespace(id=len(made), name=kind, encoding="ros2msg", data=texts[kind].encode())
            made[kind] = mcap.DecoderFactory().decoder_for("cdr", schema)
        return made[kind](data)

    return read


def pixels(message, dtype):
    return np.frombuffer(message.data, dtype).reshape(message.height, message.width)


def stamp_ns(time):
    return time.sec * 10**9 + time.nanosec


def test_frames_are_those_of_the_simulation(scenario, flown, decode):
    simulation = rl.Simulation(scenario)
    frames = [simulation.step(rl.Command(), dt_s=0.1)]
    pointed = rl.Command(pan_rad=0.775, tilt_rad=0.01)
    frames += [frame for _ in flown[1:] if (frame := simulation.step(pointed, dt_s=0.1)) is not None]
    with_frame = [{topic: decode(kind, data) for topic, kind, data in step} for step in flown if len(step) > 8]
    assert len(with_frame) == len(frames) == 4
    for frame, ours in zip(frames, with_frame, strict=True):
        at_ns = to_stamp_ns(frame.source.start_utc, frame.time_s)
        for topic in ("/lidar/range", "/lidar/intensity", "/lidar/points", "/lidar/camera_info", "/labels/target"):
            header = ours[topic].header
            assert (header.frame_id, stamp_ns(header.stamp)) == ("lidar", at_ns)
        np.testing.assert_array_equal(pixels(ours["/lidar/range"], "<f4"), frame.range_m)
        np.testing.assert_array_equal(pixels(ours["/lidar/intensity"], "<u2"), frame.intensity_counts)
        np.testing.assert_array_equal(pixels(ours["/labels/target"], "<i2"), frame.labels.target)
        cloud = np.frombuffer(ours["/lidar/points"].data, "<f4").reshape(16, 16, 4)
        np.testing.assert_array_equal(cloud[..., :3], frame.points_m.astype("f4"))
        assert [field.name for field in ours["/lidar/points"].fields] == ["x", "y", "z", "intensity"]
        joints = ours["/ptu/joint_states"]
        assert (joints.name, joints.position) == (["pan", "tilt"], frame.observation.pan_tilt_rad.tolist())
        assert stamp_ns(joints.header.stamp) == at_ns
        moves = {one.child_frame_id: one for one in ours["/tf"].transforms}
        move, turn = moves["lidar"].transform.translation, moves["lidar"].transform.rotation
        rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
        parent_from_lidar = RigidTransform.from_components([move.x, move.y, move.z], rotation)
        expected = frame.truth.pose(moves["lidar"].header.frame_id, "lidar")
        np.testing.assert_allclose(parent_from_lidar.as_matrix(), expected.as_matrix(), atol=1e-14)
        assert {"imu", "stage", "follower"} <= {name.removeprefix("sensors/") for name in moves}


def test_the_clock_and_the_samples_come_with_every_step(scenario, flown, decode):
    start_ns = to_stamp_ns(next(iter(rl.simulate(scenario, frames=[0]))).source.start_utc, 0.0)
    simulation, rates = rl.Simulation(scenario), []
    for number, step in enumerate(flown):
        simulation.step(dt_s=0.1)
        rates += simulation.samples["imu"].angular_velocity_rad_s.tolist()
        (topic, kind, data), *_ = step
        assert topic == "/clock"
        end_s = min(0.1 * (number + 1), 1.5)  # the run ends at the last flash
        assert stamp_ns(decode(kind, data).clock) == start_ns + round(end_s * 1e9)
    unit = [decode(kind, data) for step in flown for topic, kind, data in step if topic == "/sensors/imu/imu"]
    assert len(unit) == len(rates) == 31
    np.testing.assert_array_equal(
        [[one.angular_velocity.x, one.angular_velocity.z] for one in unit], np.array(rates)[:, ::2]
    )
    assert [stamp_ns(one.header.stamp) - start_ns for one in unit] == [50_000_000 * k for k in range(31)]
    assert unit[0].header.frame_id == "sensors/imu" and unit[0].linear_acceleration_covariance[0] == 0.0
    places = [topic for step in flown for topic, *_ in step if topic == "/sensors/gnss/position"]
    assert len(places) == 2


def test_truth_is_not_published_where_it_is_switched_off(example, scenario, flown):
    lidar = example.SteppedLidar(scenario, 0.1, publishes_truth=False)
    topics = {topic for topic, *_ in lidar.step()}
    with_truth = {topic for topic, *_ in flown[0]}
    assert with_truth - topics == {"/tf", "/labels/target", "/labels/part"}
    assert "/lidar/points" in topics


def test_thrust_reaches_the_body_and_an_impossible_command_is_discarded(example):
    scenario = rl.Scenario.load(EXAMPLES / "thrusters.toml", settings=SMALL, trust_code=True)
    lidar, simulation = example.SteppedLidar(scenario, 0.5), rl.Simulation(scenario)
    lidar.push("follower", [0.02, 0.0, -0.01])
    for _ in range(2):
        lidar.step()
        simulation.step(rl.Command(inputs={"follower": (0.02, 0.0, -0.01)}), dt_s=0.5)
    ours, theirs = (one.truth.pose("stage", "follower").translation for one in (lidar.simulation, simulation))
    np.testing.assert_array_equal(ours, theirs)
    again = example.SteppedLidar(scenario, 0.5)
    again.push("nobody", [1.0])
    with pytest.raises(ScenarioError, match="nobody"):
        again.step()
    assert again.step()


@pytest.mark.parametrize("release", ["humble", "kilted"])
def test_releases_agree_on_the_bytes(example, scenario, flown, release):
    assert example.SteppedLidar(scenario, 0.1, release=release).step() == flown[0]


def test_requests_that_are_wrong_have_one_line_and_the_run_goes_on(example):
    lidar = example.SteppedLidar(rl.Scenario.load(EXAMPLES / "thrusters.toml", settings=SMALL, trust_code=True), 0.5)
    for line in (
        b"",
        b"[]",
        b"{",
        b'{"inputs": {"nobody": [1]}}',
        b'{"inputs": {"follower": 1}}',
        b'{"angles": {"pan": "x"}}',
        b'{"angles": {"pan": 1' + b"0" * 400 + b"}}",
        b"[" * 100_000,
    ):
        head, *messages = example.answer(lidar, line)
        head = json.loads(head)
        assert head["error"] and "\n" not in head["error"] and not messages and head["messages"] == []
    head, *messages = example.answer(lidar, b"{}")
    assert [len(one) for one in messages] == [length for *_, length in json.loads(head)["messages"]]


@pytest.mark.slow
def test_the_process_behind_the_node_flies_the_same(example, tmp_path):
    path = tmp_path / "thrusters.toml"
    whole = (EXAMPLES / "thrusters.toml").read_text(encoding="utf-8").replace("= 600", "= 2")
    path.write_text(whole.replace("rays_per_pixel      = 4", "rays_per_pixel = 1\nn_rows = 16\nn_cols = 16"))
    (tmp_path / "thrusters.py").write_bytes((EXAMPLES / "thrusters.py").read_bytes())
    requests = [b'{"inputs": {"follower": [0.02, 0, 0]}}', b"{}", b"{}"]
    command = [sys.executable, FOLDER / "messages.py", path, "--step", "0.4", "--no-truth", "--trust-code"]
    run = subprocess.run(command, input=b"\n".join(requests), capture_output=True, timeout=60)
    assert (run.returncode, run.stderr) == (0, b"")
    lidar = example.SteppedLidar(rl.Scenario.load(path, trust_code=True), 0.4, publishes_truth=False)
    expected = [b'{"inputs": ["follower"]}\n']
    for line in requests:
        expected += example.answer(lidar, line)
    assert run.stdout == b"".join(expected)
    assert b'"is_over": true' in run.stdout


def test_a_scenario_that_is_not_there_is_one_line(example, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "argv", ["messages.py", str(tmp_path / "none.toml")])
    with pytest.raises(SystemExit, match=r"^messages\.py: .*none\.toml.*$"):
        example.main()


def test_a_flash_is_told_by_the_message_of_the_package(example, scenario):
    lidar = example.SteppedLidar(scenario, 0.1, definitions=MESSAGES / "msg")
    (data,) = [data for topic, kind, data in lidar.step() if (topic, kind) == ("/lidar/flash", example.FLASH)]
    message, frame = lidar.types.deserialize_cdr(data, example.FLASH), next(rl.simulate(scenario, frames=[0]))
    assert (message.index, message.header.frame_id) == (0, "lidar")
    assert message.returns == frame.valid.sum() and message.saturated == frame.observation.reading.saturated.sum()
    assert dict(zip(message.setting_names, message.setting_values, strict=True)) == dict(frame.observation.settings)
    assert not [topic for topic, *_ in example.SteppedLidar(scenario, 0.1).step() if topic == "/lidar/flash"]


def test_the_packages_state_what_they_hold():
    """The name in package.xml is that of its folder, and what the code imports is among its dependencies."""
    for folder in (PACKAGE, MESSAGES):
        tree = ElementTree.parse(folder / "package.xml").getroot()
        assert (tree.get("format"), tree.findtext("name")) == ("3", folder.name)
        assert tree.findtext("license") == "MIT" and tree.find("maintainer").get("email")
        assert tree.findtext("export/build_type") == {PACKAGE: "ament_python", MESSAGES: "ament_cmake"}[folder]
    needed = {node.text for node in ElementTree.parse(PACKAGE / "package.xml").getroot().iter("exec_depend")}
    code = ast.parse((FOLDER / "node.py").read_text(encoding="utf-8"))
    imported = {node.module.partition(".")[0] for node in ast.walk(code) if isinstance(node, ast.ImportFrom)}
    imported |= {alias.name for node in ast.walk(code) if isinstance(node, ast.Import) for alias in node.names}
    assert {name for name in imported if name not in sys.stdlib_module_names} <= needed
    assert 'rosidl_generate_interfaces(${PROJECT_NAME} "msg/Flash.msg"' in (MESSAGES / "CMakeLists.txt").read_text()
    setup = (PACKAGE / "setup.py").read_text()
    assert all((PACKAGE / name).exists() for name in ("resource/rso_lidar_ros", "launch/lidar.launch.py", "setup.cfg"))
    assert 'f"node = {NAME}.node:main"' in setup


def test_the_launch_file_gives_the_node_all_its_parameters(monkeypatch):
    """With stand-ins for `launch` and `launch_ros`, which keep what they are given."""

    def keep(*given, **named):
        return given, named

    for name in ("launch", "launch.actions", "launch.substitutions", "launch_ros", "launch_ros.actions"):
        monkeypatch.setitem(sys.modules, name, SimpleNamespace())
    sys.modules["launch"].LaunchDescription = list
    sys.modules["launch.actions"].DeclareLaunchArgument = keep
    sys.modules["launch.substitutions"].LaunchConfiguration = sys.modules["launch_ros.actions"].Node = keep
    stand_in = SimpleNamespace(ParameterValue=keep)
    monkeypatch.setitem(sys.modules, "launch_ros.parameter_descriptions", stand_in)
    launched = runpy.run_path(str(PACKAGE / "launch" / "lidar.launch.py"))["generate_launch_description"]()
    *arguments, (_, node) = launched
    assert (node["package"], node["executable"]) == ("rso_lidar_ros", "node")
    text = (FOLDER / "node.py").read_text(encoding="utf-8")
    declared = dict(re.findall(r'declare_parameter\("(\w+)", (.+?)\)', text))
    assert set(node["parameters"][0]) == set(declared) and [given for given, _ in arguments] == [
        ("scenario",),
        *[(name,) for name in node["parameters"][0]],
    ]
    for (name,), named in arguments[1:]:
        kind = node["parameters"][0][name][1]["value_type"]
        assert type(ast.literal_eval(declared[name])) is kind
        assert str(ast.literal_eval(declared[name])).lower() == named["default_value"]


def test_the_node_compiles_and_its_error_names_rclpy():
    """Without ROS nothing else of it can be tested."""
    code = compile((FOLDER / "node.py").read_text(encoding="utf-8"), "node.py", "exec")
    if importlib.util.find_spec("rclpy") is None:
        with pytest.raises(ModuleNotFoundError, match="rclpy"):
            exec(code, {"__name__": "example"})
