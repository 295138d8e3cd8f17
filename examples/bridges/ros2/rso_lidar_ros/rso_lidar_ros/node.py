"""A ROS 2 node that flies a scenario and publishes what the lidar and the other sensors measure; README.md has the topics.

It needs neither rso_lidar nor NumPy: messages.py runs beside it, in a process with the Python where rso_lidar is installed.

ros2 run rso_lidar_ros node SCENARIO --ros-args -p python:=/path/to/venv/bin/python
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import rclpy
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from rosidl_runtime_py.utilities import get_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray


class LidarNode(Node):
    """Steps the simulation by a timer of the wall clock, and publishes `/clock` for nodes with use_sim_time."""

    def __init__(self, scenario):
        super().__init__("rso_lidar")
        step_s = self.declare_parameter("step_s", 0.02).value
        factor = self.declare_parameter("real_time_factor", 1.0).value
        python = self.declare_parameter("python", "python3").value
        command = [python, str(Path(__file__).with_name("messages.py")), scenario, "--step", str(step_s)]
        command += ["--release", os.environ.get("ROS_DISTRO", "jazzy")]
        try:
            command += ["--definitions", str(Path(get_package_share_directory("rso_lidar_msgs"), "msg"))]
        except PackageNotFoundError:
            self.get_logger().warning("/lidar/flash is not published: build the package rso_lidar_msgs, and source it")
        if not self.declare_parameter("truth", True).value:
            command.append("--no-truth")
        if self.declare_parameter("trust_code", False).value:
            command.append("--trust-code")
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # that of ROS's Python
        self.process = subprocess.Popen(command, **pipes, env=variables)
        self.topics, self.angles, self.inputs = {}, {}, {}
        self.create_subscription(JointState, "/ptu/command", self.take_angles, 10)
        for body in self.read_line()["inputs"]:
            topic = f"/inputs/{body.replace('.', '/')}"
            self.create_subscription(
                Float64MultiArray, topic, lambda message, name=body: self.take_inputs(name, message), 10
            )
        # A timer of the ROS clock would wait for the /clock that only this node publishes.
        self.timer = self.create_timer(step_s / factor, self.step, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def take_angles(self, message):
        self.angles.update(zip(message.name, message.position))  # noqa: B905 (a message may be wrong; ROS has Python 3.10)

    def take_inputs(self, body, message):
        self.inputs[body] = list(message.data)

    def read_line(self):
        """Return the next line of the process; end the node if the process has ended, which has printed the reason."""
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(self.process.wait() or 1)
        return json.loads(line)

    def step(self):
        """Step, and publish all messages as the bytes that they are."""
        request = {"angles": self.angles, "inputs": self.inputs}
        self.angles, self.inputs = {}, {}
        self.process.stdin.write(json.dumps(request).encode() + b"\n")
        self.process.stdin.flush()
        answer = self.read_line()
        if answer["error"]:
            self.get_logger().error(answer["error"])
        for topic, kind, length in answer["messages"]:
            data = self.process.stdout.read(length)
            if topic not in self.topics:
                self.topics[topic] = self.create_publisher(get_message(kind), topic, 10)
            self.topics[topic].publish(data)
        if answer["is_over"]:
            raise SystemExit(0)


def main():
    rclpy.init(args=sys.argv)
    try:
        rclpy.spin(LidarNode(remove_ros_args(sys.argv)[1]))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
