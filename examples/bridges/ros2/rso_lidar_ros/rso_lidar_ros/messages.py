"""The part of the node without ROS: a simulation stepped under commands, and its messages in CDR bytes.

Topics and messages are those of the MCAP files and rosbag2 folders of rso_lidar, made by the same code. `node.py` runs this
file as a process, with the Python in which rso_lidar is installed, and exchanges messages with it through pipes.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import rso_lidar as rl
from rso_lidar.export.formats.mcap import RosStream, to_ros_time

CLOCK, JOINTS, FLASH = "rosgraph_msgs/msg/Clock", "sensor_msgs/msg/JointState", "rso_lidar_msgs/msg/Flash"
TRUTH = ("/tf", "/labels/")


class SteppedLidar:
    """A simulation that goes on by `step_s` at a time, and what is published after each step.

    Parameters
    ----------
    scenario : to be flown.
    step_s : length of a step [s], at most the time between two flashes.
    publishes_truth : whether true poses (`/tf`) and labels are published.
    release : ROS 2 release, such as ``jazzy``, whose message definitions are used.
    definitions : folder of Flash.msg, of the package rso_lidar_msgs; without it no `/lidar/flash` is published.
    """

    def __init__(self, scenario, step_s=0.02, *, publishes_truth=True, release="jazzy", definitions=None):
        self.simulation, self.step_s, self.publishes_truth = rl.Simulation(scenario), step_s, publishes_truth
        self.types, self.stream, self.command = get_typestore(Stores[f"ROS2_{release.upper()}"]), None, rl.Command()
        if definitions is not None:
            text = Path(definitions, "Flash.msg").read_text(encoding="utf-8")
            self.types.register(get_types_from_msg(text, FLASH))

    @property
    def is_over(self):
        return self.simulation.is_over

    def point(self, angles_rad):
        """Point the PTU: `pan` (left is positive) and `tilt` (up), by name. An axis that is not named keeps its command."""
        angles = {name: float(angle) for name, angle in angles_rad.items() if math.isfinite(angle)}
        pan, tilt = (angles.get(axis, getattr(self.command, f"{axis}_rad")) for axis in ("pan", "tilt"))
        self.command = rl.Command(pan_rad=pan, tilt_rad=tilt, inputs=self.command.inputs)

    def push(self, body, values):
        """Set the inputs u of the state-space model of a body: thrust or torque in the units of the model."""
        if not np.isfinite(np.array(values, dtype=float)).all():
            raise ValueError(f"inputs of '{body}' are not finite")
        inputs = {**(self.command.inputs or {}), body: tuple(float(value) for value in values)}
        self.command = rl.Command(pan_rad=self.command.pan_rad, tilt_rad=self.command.tilt_rad, inputs=inputs)

    def step(self):
        """Go on by a step, and return (topic, type, CDR bytes) of each message, in the order of publication."""
        try:
            frame = self.simulation.step(self.command, dt_s=self.step_s)
        except rl.ScenarioError:
            self.command = rl.Command()  # else an impossible one is refused at every step
            raise
        made = []
        if self.stream is None:  # the first step contains the first flash, at t = 0
            self.stream = RosStream(frame)
        stream = self.stream
        clock = {"clock": to_ros_time(stream.to_stamp_ns(self.simulation.time_s))}
        found = [
            (topic, stream.kinds[topic], body) for topic, body, _ in stream.convert_samples(self.simulation.samples)
        ]
        if frame is not None:
            found += [(topic, stream.kinds[topic], body) for topic, body, _ in stream.convert_frame(frame)]
            if frame.observation.pan_tilt_rad is not None:
                stamp = {"stamp": to_ros_time(stream.to_stamp_ns(frame.time_s)), "frame_id": ""}
                joints = {
                    "name": ["pan", "tilt"],
                    "position": frame.observation.pan_tilt_rad,
                    "velocity": [],
                    "effort": [],
                }
                found.append(("/ptu/joint_states", JOINTS, {"header": stamp} | joints))
            found.append(("/lidar/flash", FLASH, self._describe_flash(frame)))
        for topic, kind, body in [("/clock", CLOCK, clock), *found]:
            is_published = self.publishes_truth or not topic.startswith(TRUTH)
            if is_published and kind in self.types.fielddefs:  # ROS has no type for sensors of a user's own
                made.append((topic, kind, bytes(self.types.serialize_cdr(self.build(kind, body), kind))))
        return made

    def _describe_flash(self, frame):
        reading, settings = frame.observation.reading, frame.observation.settings
        return {
            "header": {"stamp": to_ros_time(self.stream.to_stamp_ns(frame.time_s)), "frame_id": "lidar"},
            "index": frame.index,
            "returns": int(np.isfinite(reading.range_m).sum()),
            "saturated": int(np.count_nonzero(reading.saturated)),
            "setting_names": list(settings),
            "setting_values": [value if math.isfinite(value) else math.nan for value in settings.values()],
        }

    def build(self, kind, body):
        """Return a message of rosbags made of a dictionary."""
        fields = {name: self._convert(body[name], *definition) for name, definition in self.types.fielddefs[kind][1]}
        return self.types.types[kind](**fields)

    def _convert(self, value, node, of):
        """Return the value of a field.

        Parameters
        ----------
        value : as a dictionary, list, bytes or array has it.
        node, of : kind of the field, and its type.
        """
        if node == Nodetype.NAME:
            return self.build(of, value)
        if node == Nodetype.BASE:
            return value
        (inner, of_inner), _ = of
        if inner == Nodetype.NAME:
            return [self.build(of_inner, one) for one in value]
        if of_inner[0] == "string":
            return list(value)
        return np.frombuffer(value, "u1") if isinstance(value, bytes) else np.asarray(value, of_inner[0])


def answer(lidar, line):
    """Carry out a request, a line of JSON, and step. Return the parts of the answer: a line of JSON, and the messages.

    Parameters
    ----------
    lidar : a `SteppedLidar`.
    line : an object with `angles` (of the PTU, by axis) and `inputs` (rows, by body), both optional.
    """
    made, error = [], ""
    try:
        request = json.loads(line)
        lidar.point(request.get("angles", {}))
        for body, values in request.get("inputs", {}).items():
            lidar.push(body, values)
        made = lidar.step()
    except (rl.RsoLidarError, ValueError, TypeError, AttributeError, OverflowError, RecursionError) as fault:
        error = " ".join(str(fault).split())
    listed = [[topic, kind, len(data)] for topic, kind, data in made]
    head = {"messages": listed, "is_over": lidar.is_over, "error": error}
    return [json.dumps(head).encode() + b"\n", *(data for *_, data in made)]


def main():
    parser = argparse.ArgumentParser(description="Answer each line of standard input with the messages of a step.")
    parser.add_argument("scenario")
    parser.add_argument("--step", type=float, default=0.02, help="length of a step [s]")
    parser.add_argument("--release", default="jazzy", help="ROS 2 release")
    parser.add_argument("--definitions", metavar="FOLDER", help="of Flash.msg, of the package rso_lidar_msgs")
    parser.add_argument("--no-truth", action="store_true", help="leave out /tf and /labels")
    parser.add_argument("--trust-code", action="store_true", help="run the Python code that the scenario names")
    given = parser.parse_args()
    try:
        scenario = rl.Scenario.load(given.scenario, trust_code=given.trust_code)
        chosen = {"release": given.release, "definitions": given.definitions}
        lidar = SteppedLidar(scenario, given.step, publishes_truth=not given.no_truth, **chosen)
    except (rl.RsoLidarError, OSError) as error:
        raise SystemExit(f"messages.py: {error}") from None
    bodies = [name for body in scenario.bodies for name in body.models]
    sys.stdout.buffer.write(json.dumps({"inputs": bodies}).encode() + b"\n")
    sys.stdout.buffer.flush()
    for line in sys.stdin.buffer:
        sys.stdout.buffer.writelines(answer(lidar, line))
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
