"""The stages of a flash: time and share of each, on one thread and in bands on two, warm and in a new process."""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.clock import fresh, quartiles, seconds
from benchmarks.report import Findings, Target, table
from rso_lidar import detector, motion, optics, scene
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.export import Recorder
from rso_lidar.records import Frame, Observation

ROWS = ("truth", "extent", "rays", "cast", "collect", "waveform", "detect", "label", "write")
Spans = dict[str, float]


class Clock:
    """Takes the time of one stage after another: of this thread alone, or by the clock on the wall."""

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        self.now, self.spans = now, Spans()

    def __call__(self, stage: str, work: Callable[..., Any], *arguments: Any, **more: Any) -> Any:
        """Return what a stage returns, and remember how long it took [s]."""
        start = self.now()
        result = work(*arguments, **more)
        self.spans[stage] = self.spans.get(stage, 0.0) + self.now() - start
        return result


class Flight:
    """A scenario on its way: the lines of `simulate` and `flash`, one by one, each with its time."""

    def __init__(self, scenario: rl.Scenario) -> None:
        self.scenario = scenario
        self.folder = tempfile.TemporaryDirectory()
        world: Any = {"local": scenario.is_local, "sun_direction": scenario.world.sun_direction}
        bodies, n_frames = scenario.bodies, scenario.time.n_frames
        start = time.perf_counter()
        self.course = motion.Course(bodies, scenario.epochs(np.arange(n_frames)), **world)
        self.aim = motion.Aim(scenario.pan_tilt, scenario.lidar.mount, bodies, *scenario.span, **world)
        self.course_s = (time.perf_counter() - start) / n_frames  # worked out for all frames at once
        path = Path(self.folder.name, "frames.h5")
        self.recorder = Recorder(path, scenario.source, run_id="benchmark").__enter__()

    def close(self) -> None:
        """Finish the file, and throw it away."""
        self.recorder.__exit__(None, None, None)
        self.folder.cleanup()

    def frame(self, k: int, threads: int = 1, now: Callable[[], float] = time.perf_counter) -> Spans:
        """Return the seconds that each stage of frame k takes; casting and the chain work in bands on `threads`."""
        scenario, clock = self.scenario, Clock(now)
        k %= scenario.time.n_frames
        surfaces, lidar, rng = scenario.surfaces, scenario.instrument, scenario.rng(k)
        truth = clock("truth", lambda: self.aim.at(self.course.at(k, None), None, scenario.rng(k, 1)))
        laser, late_s = lidar.laser.fire(rng)
        extent = clock("extent", scene.extent, surfaces, truth)
        rays = clock("rays", optics.pixel_rays, lidar.receiver, laser, extent)
        lit = {"laser_from_m": laser.offset, "sun": lidar.receiver.filter_width_nm is not None}
        hits = clock("cast", scene.cast, rays, surfaces, truth, threads, **lit, aperture_m=lidar.receiver.aperture_m)
        photons = clock("collect", optics.collect, hits, laser, lidar.receiver, late_s)
        if lidar.detector.type == "gsfl":
            camera = camera_of(lidar.detector, photons)
            waveforms, _ = clock("waveform", store_waveforms, camera, photons, rng, threads=threads)
            reading = clock("detect", measure, camera.processor, waveforms, rng)
        else:
            reading, _ = clock("detect", detector.detect, photons, lidar.detector, rng, threads)
        labels = clock("label", scene.label, hits, photons, lidar.max_returns)
        observation = Observation(truth.time_s, reading, lidar.settings, lidar.receiver.line_of_sight, None)
        clock("write", self.recorder.write, Frame(k, observation, labels, truth, scenario.source, {}))
        clock.spans["truth"] += self.course_s
        self.counts = len(rays.pixel), len(hits.ray)
        return clock.spans


def warm(scenario: rl.Scenario, repeats: int, ways: dict[str, int]) -> tuple[dict[str, list[Spans]], Any]:
    """Return the spans of each frame in each way (number of threads), taken in turns, and the counts of rays and hits."""
    flight = Flight(scenario)
    spans: dict[str, list[Spans]] = {way: [] for way in ways}
    for k in range(-2, repeats):  # two frames to warm up
        for way, threads in ways.items():
            made = flight.frame(k, threads, time.thread_time if threads == 1 else time.perf_counter)
            if k >= 0:
                spans[way].append(made)
    flight.close()
    return spans, flight.counts


def cold(name: str) -> Spans:
    """Return the seconds of each stage of the first frame that a process makes, and of loading what it needs."""
    scenario, clock = scenes.build(name), Clock()
    clock("load", lambda: (scenario.surfaces, scenario.source, scenario.instrument))
    flight = Flight(scenario)
    spans = clock.spans | flight.frame(0)
    flight.close()
    return spans


def medians(spans: list[Spans]) -> Spans:
    """Return the median of each stage over some frames [s]."""
    return {stage: float(np.median([one[stage] for one in spans])) for stage in spans[0]}


def flash_s(spans: Spans) -> float:
    """Return the seconds of a frame without its file."""
    return sum(value for stage, value in spans.items() if stage not in ("write", "load"))


def frame_rate(scenario: rl.Scenario, threads: int, span_s: float) -> float:
    """Return the frames per second of the whole walk, warm: all frames over all time, for about `span_s`."""
    n_all = scenario.time.n_frames
    few = min(4, n_all)
    pace = seconds(lambda: sum(1 for _ in rl.simulate(scenario, threads=threads, frames=range(few)))) / few
    many = int(np.clip(span_s / pace, few, n_all))
    return many / seconds(lambda: sum(1 for _ in rl.simulate(scenario, threads=threads, frames=range(many))))


def stage_table(name: str, repeats: int) -> tuple[str, list[str], list[Target]]:
    """Return the table of one scene, its row in the table of all, and what was wanted of it."""
    scenario = scenes.build(name)
    ways = {"one": 1, "bands": 2}
    spans, (n_rays, n_hits) = warm(scenario, repeats, ways)
    first = fresh(cold, name)
    middle = {way: medians(of) for way, of in spans.items()}
    whole = flash_s(middle["one"])
    rows = []
    for stage in ROWS:
        now, bands = (middle[way][stage] * 1e3 for way in ways)
        share = "" if stage == "write" else f"{now / whole / 10:.0f} %"
        rows.append((stage, f"{now:.2f}", share, f"{bands:.2f}", f"{first[stage] * 1e3:.1f}"))
    ratios = np.array([flash_s(b) / flash_s(a) for a, b in zip(spans["one"], spans["bands"], strict=True)])
    now, bands = (flash_s(middle[way]) * 1e3 for way in ways)
    rows.append(("flash, all but write", f"**{now:.2f}**", "100 %", f"{bands:.2f}", f"{flash_s(first) * 1e3:.1f}"))
    header = f"{name} [ms]", "one thread", "share", "bands on 2 threads", "first frame of a process"
    facets = sum(len(surface.facets) for surface in scenario.surfaces)
    said = f"{facets:,} facets, {n_rays:,} rays, {n_hits:,} hits; loading, once: {first['load'] * 1e3:.0f} ms."
    span_s = 0.1 * repeats
    rates = [f"{frame_rate(scenario, threads, span_s):.0f}" for threads in (1, 2)]
    summary = [name, f"{n_rays:,}", f"{n_hits:,}", f"{now:.2f}", quartiles(ratios), *rates]
    targets = []
    if name == "TDRS, 300 m":
        most, ratio = 0.6, float(np.median(ratios))
        what = f"{name}: a flash in bands on two threads, as under a controller, over one thread"
        targets.append(Target(what, f"at most {most:g} ×", f"{quartiles(ratios)} ×", ratio <= most))
    if name == "TDRS, 1 km":
        most, share = 0.25, np.array([one["write"] / flash_s(one) for one in spans["one"]])
        what = f"{name}: `write` over the flash"
        targets.append(Target(what, f"at most {most:g} ×", f"{quartiles(share)} ×", float(np.median(share)) <= most))
    return f"{said}\n\n{table(header, rows)}", summary, targets


def instruments(span_s: float) -> str:
    """Return the frame rate with each detector, and with a lens that blurs, at 300 m."""
    blurring = scenes.instrument(psf=rl.optics.GaussianPsf(sigma_um=25.0))
    kinds = {
        "`gsfl`, the whole chain": scenes.instrument(),
        "`gsfl`, Gaussian PSF of 25 µm": blurring,
        "`empirical`": scenes.instrument().replace(detector=rl.Empirical()),
    }
    flown = {name: scenes.single("tdrs", 300.0, 40, lidar) for name, lidar in kinds.items()}
    rates = {name: [frame_rate(one, 2, span_s) for _ in range(2)] for name, one in flown.items()}
    return table(("TDRS, 300 m, 2 threads", "frames/s"), [(name, f"{max(of):.0f}") for name, of in rates.items()])


def run(*, quick: bool) -> Findings:
    """Return the tables of all scenes."""
    repeats = 7 if quick else 21
    tables, summary, targets = [], [], []
    for name in scenes.available():
        print(f"stages: {name}", file=sys.stderr)
        block, row, wanted = stage_table(name, repeats)
        tables.append(block)
        summary.append(row)
        targets += wanted
    header = (
        "scene", "rays", "hits", "flash, one thread [ms]", "in bands on 2 / on one", "frames/s, 1 thread", "2 threads",
    )  # fmt: skip
    blocks = {"walk": table(header, summary), "stages": "\n\n".join(tables)}
    blocks["instruments"] = instruments(0.1 * repeats)
    return Findings(blocks, targets)
