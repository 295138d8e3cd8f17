"""
Flight software in another process
==================================

`rso-lidar serve` puts a simulation behind a socket, and flight software in any language drives it step by step. The
package has clients in Python, C, Rust and MATLAB; this page runs the one in Python. It needs `pip install
"rso-lidar[loop]"`.
"""

import subprocess
import sys

from matplotlib.figure import Figure

from rso_lidar.shipped import shipped

# %%
# The server is a process of its own. It takes a free port and prints it. Ten seconds of a tumbling stage are served.
software = shipped("examples/flight_software")
command = [sys.executable, "-m", "rso_lidar", "serve", str(software / "tumbling_stage.toml")]
command += ["--bind", "tcp://127.0.0.1:*", "--set", "time.duration_s=10"]
server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
line = ""
while "tcp://" not in line:
    line = server.stdout.readline()
    if not line and server.poll() is not None:
        raise RuntimeError("the server ended; is pyzmq installed?")
endpoint = next(word.strip(",;.()") for word in line.split() if word.startswith("tcp://"))

# %%
# The client uses pyzmq, json and numpy only: it reads the range image, finds the target, and commands the PTU.
client = subprocess.run(
    [sys.executable, str(software / "pointing.py"), endpoint], capture_output=True, text=True, timeout=120, check=True
)
server.wait(timeout=30)
rows = [[float(word) for word in line.split()] for line in client.stdout.splitlines()]
print(client.stdout[:160] + "...")

# %%
# What the client saw: the number of returns of the stage, and the angle of their mean direction off the boresight.
figure = Figure(figsize=(8, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot([row[0] for row in rows], [row[2] for row in rows], ".-")
axes.set(xlabel="time [s]", ylabel="off the boresight [deg]", title="Pointing by a client in another process")
axes.grid()
figure

# %%
# **To try.** Compile `pointing.c`. Add delays and losses with `[link]` in the scenario. Every byte of the protocol:
# :doc:`/protocol`.
