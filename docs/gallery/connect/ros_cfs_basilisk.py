"""
ROS 2, core Flight System and Basilisk
======================================

Short programs in `examples/bridges` connect a simulation to other frameworks. They need those frameworks, so
that this page does not run them: it shows what they exchange, and runs what needs rso_lidar only.

- **ROS 2** (`examples/bridges/ros2`): packages for colcon. A node has the topics of our MCAP files; `node.py` runs in the
  Python of ROS and exchanges bytes with a process that holds the simulation.
- **cFS** (`examples/bridges/cfs`): readings as CCSDS space packets over UDP, telecommands back, and the telemetry
  described as XTCE.
- **Basilisk** (`examples/bridges/basilisk`): two spacecraft of Basilisk, one of which carries the lidar as a module.
- **bsk_rl** (`examples/bridges/bsk_rl`): its published inspection task, observed by our frames.

Each folder has a page that says what was tested.
"""

import rso_lidar as rl
from rso_lidar import picture

# %%
# All do what this loop does: step a simulation by a time that is shorter than the interval of the flashes, send
# what the spacecraft could know, and apply a command.
scenario = rl.Scenario.load("examples/flight_software/tumbling_stage.toml", ("time.duration_s=3",))
frames = []
with rl.Simulation(scenario) as simulation:
    command = rl.Command()
    while not simulation.is_over:
        frame = simulation.step(command, dt_s=0.05)
        if frame is None:
            continue  # no flash in this step
        frames.append(frame)
        pan_rad, tilt_rad = simulation.observation.pan_tilt_rad  # to be sent; a command would come back
        command = rl.Command(pan_rad=float(pan_rad), tilt_rad=float(tilt_rad))
print(f"{len(frames)} flashes in {simulation.time_s:.0f} s")

# %%
picture.frame_figure(frames[-1])

# %%
# **To try.** For ROS without a node, write a bag: :doc:`/auto_gallery/how_do_i/point_cloud_to_ros`. The interfaces:
# :doc:`/loop`.
