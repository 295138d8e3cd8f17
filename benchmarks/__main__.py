"""How fast the walk is: `python -m benchmarks [mesh.stl]` prints a table. Nothing here is asserted.

Machines differ and are shared, so the figure to compare is the ratio to bare embree on the same rays in the same run.
"""

import argparse
import os
import resource
import sys
import time
from pathlib import Path

import numpy as np

import rso_lidar as rl
from rso_lidar import detector, optics, scene

SCENARIO = """
version = 1
name    = "benchmark: {range_m:g} m"
seed    = 1

[world]
axes = "local"

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = {frames}
frame_rate_hz = 1

[[target]]
name   = "tdrs"
model  = "{model}"
center_of_mass_m = [0, 0, 0]
motion = {{ type = "fixed", position_m = [{range_m}, 0, 0] }}
attitude = {{ type = "spin", axis = [0.3, 0.5, 1], rate_deg_s = 1.0, quaternion_xyzw = [0.5, 0.5, 0.5, 0.5] }}

[follower]
motion = {{ type = "fixed", position_m = [0, 0, 0] }}

[lidar.receiver]
fov_deg  = 2.5
f_number = 2.8
rays_per_pixel = 16
"""


def build(model, range_m, frames):
    """Return the benchmark's scenario: a relay satellite that fills the field at 300 m, labels on, no file."""
    return rl.Scenario.loads(SCENARIO.format(model=model, range_m=range_m, frames=frames))


def frame_rate(scenario, threads, seconds=4.0):
    """Return the frames per second over a few seconds of the whole walk, warm.

    Frames made side by side come in pairs, so that single spans say nothing: it is all frames over all time.
    """
    frames = rl.simulate(scenario, threads=threads)
    for _ in range(4):
        next(frames)
    began, made = time.perf_counter(), 0
    while time.perf_counter() - began < seconds and next(frames, None) is not None:
        made += 1
    return made / (time.perf_counter() - began)


def instruments(scenario, threads):
    """Print the frame rate with each detector, and with a lens that blurs, side by side, twice."""
    lidar = scenario.lidar
    blurring = lidar.receiver.replace(psf=rl.GaussianPsf(sigma_um=25))
    kinds = {
        "gsfl": lidar.replace(detector=rl.Gsfl()),
        "gsfl, Gaussian PSF of 25 um": lidar.replace(detector=rl.Gsfl(), receiver=blurring),
        "empirical": lidar.replace(detector=rl.Empirical()),
    }
    print(f"\ninstruments, {threads} threads")
    rates = {name: [] for name in kinds}
    for _ in range(2):
        for name, kind in kinds.items():
            rates[name].append(frame_rate(scenario.replace(lidar=kind), threads, 3.0))
    for name, found in rates.items():
        print(f"  {name:<28} " + ", ".join(f"{rate:.1f}" for rate in found) + " frames/s")


def stages(scenario, threads, repeats=15):
    """Return the median seconds of each stage of `flash`, of bare embree on the same rays, and counts."""
    truth = next(rl.simulate(scenario, frames=[0])).truth
    surfaces, lidar = scenario.surfaces, scenario.lidar
    spans = {}

    def timed(name, work):
        start = time.perf_counter()
        result = work()
        spans.setdefault(name, []).append(time.perf_counter() - start)
        return result

    for _ in range(repeats):
        extent = timed("extent", lambda: scene.extent(surfaces, truth))
        rays = timed("rays", lambda: optics.pixel_rays(lidar.receiver, lidar.laser, extent))
        hits = timed("cast", lambda: scene.cast(rays, surfaces, truth, threads))
        photons = timed("collect", lambda: optics.collect(hits, lidar.laser, lidar.receiver))
        timed("detect", lambda: detector.detect(photons, lidar.detector, scenario.rng(0)))
        timed("label", lambda: scene.label(hits, photons))
        pose = truth.pose("tdrs", "lidar")
        along = pose.rotation.apply(rays.direction.copy()).astype(np.float32)
        start = np.broadcast_to(pose.translation, along.shape).astype(np.float32)
        timed("bare embree, 1 thread", lambda: surfaces[0].embree.run(start, along, query="INTERSECT", output=1))
    return {name: float(np.median(values)) for name, values in spans.items()}, len(rays.pixel), len(hits.ray)


def resident_mb():
    """Return the memory this process holds now [MB]."""
    statm = Path("/proc/self/statm")
    if statm.exists():
        return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def memory(model, frames):
    """Print resident memory over many frames of a distant target."""
    print(f"\nresident memory over {frames:,} frames at 3 km")
    for frame in rl.simulate(build(model, 3000.0, frames)):
        if frame.index in (100, frames // 4, frames // 2, 3 * frames // 4, frames - 1):
            print(f"  frame {frame.index:>6}  {resident_mb():8.1f} MB")


def main():
    """Run the benchmarks and print their table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("mesh", nargs="?", help="mesh to fly past (default: tdrs.stl of RSO_LIDAR_SHARED, else ours)")
    parser.add_argument(
        "--memory", type=int, default=0, metavar="FRAMES", help="also follow memory over so many frames"
    )
    chosen = parser.parse_args()
    nasa = Path(os.environ.get("RSO_LIDAR_SHARED", ""), "meshes", "tdrs.stl")
    model = chosen.mesh or (str(nasa) if nasa.is_file() else "tdrs")
    print(f"{model}, 128 x 128, 16 rays per pixel, labels on, no file; {os.cpu_count()} cores")
    for range_m in (300.0, 1000.0, 3000.0):
        scenario = build(model, range_m, 1000)
        for threads in (1, 2):
            table, n_rays, n_hits = stages(scenario, threads)
            bare = table.pop("bare embree, 1 thread")
            flash = sum(table.values())
            print(f"\n{range_m:g} m, {threads} thread{'s' * (threads > 1)}: {n_rays:,} rays, {n_hits:,} hits")
            for name, seconds in table.items():
                print(f"  {name:<10}{seconds * 1e3:8.2f} ms {seconds / flash:6.0%}")
            print(
                f"  flash     {flash * 1e3:8.2f} ms, {flash / bare:.2f} x bare embree on one thread ({bare * 1e3:.2f} ms)"
            )
            print(f"  whole walk {frame_rate(scenario, threads):7.1f} frames/s")
        if range_m == 300.0:
            instruments(scenario, 2)
    if chosen.memory:
        memory(model, chosen.memory)


if __name__ == "__main__":
    sys.exit(main())
