"""What the benchmarks look at: the instrument of Fuller et al. before spacecraft that stand still but for a slow turn."""

import datetime
import os
from collections.abc import Callable
from pathlib import Path

import rso_lidar as rl

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
FOV_DEG = 2.5
ASLANT = (0.5, 0.5, 0.5, 0.5)  # TDRS with its long side across the field
NASA = Path(os.environ.get("RSO_LIDAR_SHARED", ""), "meshes")
SHIPPED = ("tdrs", "juno", "cubesat_3u", "rocket_body")
SEEDS_CRAFT = ("dawn", "juno", "lro", "suomi_npp", "rosetta", "stardust", "tdrs")  # the seven of Fuller et al.
TEN = ("stardust", "grace", "kepler", "suomi_npp", "lro", "dawn", "juno", "hubble", "tdrs", "iss")


def mesh(name: str) -> str:
    """Return NASA's mesh of a craft where RSO_LIDAR_SHARED has it, else the name of the shipped model."""
    file = NASA / f"{name}.stl"
    return str(file) if file.is_file() else name


def has(name: str) -> bool:
    """Return whether there is any mesh of that name."""
    return mesh(name) != name or name in SHIPPED


def craft() -> tuple[str, ...]:
    """Return the names of the seven craft of Fuller et al., or of the shipped models where they are not all there."""
    return SEEDS_CRAFT if all(mesh(name) != name for name in SEEDS_CRAFT) else SHIPPED


def instrument(*, rays_per_pixel: int = 16, side: int = 128, **changes: object) -> rl.Lidar:
    """Return the camera of Fuller et al.: 2.5 degrees, f/2.8, 128 x 128 pixels, with the whole signal chain."""
    pitch_um = 100.0 * 128 / side  # the same focal plane, cut finer
    receiver = rl.Receiver(
        fov_deg=FOV_DEG,
        f_number=2.8,
        rays_per_pixel=rays_per_pixel,
        n_rows=side,
        n_cols=side,
        pixel_pitch_um=pitch_um,
        **changes,
    )
    return rl.Lidar(receiver=receiver)


def time_of(frames: int) -> rl.Time:
    """Return the instants of so many flashes, one a second."""
    return rl.Time(start_utc=START, duration_s=float(frames), frame_rate_hz=1.0)


def scenario(name: str, targets: list[rl.Target], frames: int, lidar: rl.Lidar | None = None) -> rl.Scenario:
    """Return a scenario of `frames` flashes, one a second, from a lidar that looks along +x."""
    return rl.Scenario(
        version=1,
        name=name,
        seed=1,
        world=rl.World(axes="local"),
        time=time_of(frames),
        target=tuple(targets),
        follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=lidar or instrument(),
    )


def target(
    name: str, model: str, motion: rl.Fixed | rl.motion.Table, attitude: rl.Spin | rl.Tumble | None = None
) -> rl.Target:
    """Return a target about the origin of its mesh; it turns too slowly for the scene to change unless told to."""
    slow = rl.Spin(axis=(0.3, 0.5, 1.0), rate_deg_s=0.02, quaternion_xyzw=ASLANT)
    return rl.Target(name=name, model=model, center_of_mass_m=(0.0, 0.0, 0.0), motion=motion, attitude=attitude or slow)


def single(model: str, range_m: float, frames: int = 100, lidar: rl.Lidar | None = None) -> rl.Scenario:
    """Return a scenario with one target in the middle of the field."""
    place = rl.Fixed(position_m=(range_m, 0.0, 0.0))
    return scenario(f"{Path(model).stem}, {range_m:g} m", [target("craft", mesh(model), place)], frames, lidar)


def fleet(model: str, n: int, *, columns: int, spacing_m: float, frames: int = 100) -> rl.Scenario:
    """Return a scenario with n targets in a grid at 3 km, each in front of the sky."""
    rows = -(-n // columns)
    targets = []
    for k in range(n):
        row, col = divmod(k, columns)
        left, up = (0.5 * (columns - 1) - col) * spacing_m, (0.5 * (rows - 1) - row) * spacing_m
        targets.append(target(f"craft_{k}", mesh(model), rl.Fixed(position_m=(3000.0 + k, left, up))))
    return scenario(f"{n} targets, 3 km", targets, frames)


def crowd(frames: int = 100) -> rl.Scenario:
    """Return a scenario with ten different craft from 300 m to 3 km, farther by a like factor each, the ISS behind all."""
    targets = []
    for k, name in enumerate(TEN):
        range_m = 300.0 * 10.0 ** (k / 9)
        left, up = ((2 - k % 5) * 0.45, (0.5 - k // 5) * 0.9) if name != "iss" else (0.0, 0.0)
        place = (range_m, range_m * left * rl.units.DEG, range_m * up * rl.units.DEG)
        targets.append(target(name, mesh(name), rl.Fixed(position_m=place)))
    return scenario("ten craft, 0.3 to 3 km", targets, frames)


def ground(frames: int = 100) -> rl.Scenario:
    """Return a scenario with a lens of 30 degrees 300 m above 256 m of cratered ground, which fills the field."""
    receiver = rl.Receiver(fov_deg=30.0, f_number=1.2, rays_per_pixel=16)
    terrain = rl.CratersAndBoulders(seed=3, size_m=256.0, cell_m=0.5)
    place = rl.Fixed(position_m=(300.0, 0.0, 0.0))
    facing = rl.FixedAttitude(euler_zyx_deg=(0.0, -90.0, 0.0))
    site = rl.Target(name="site", terrain=terrain, material="regolith_highland", motion=place, attitude=facing)
    return scenario("ground, 300 m", [site], frames, rl.Lidar(laser=rl.Laser(divergence_deg=30.0), receiver=receiver))


SCENES: dict[str, tuple[str, Callable[[], rl.Scenario]]] = {
    "TDRS, 300 m": ("tdrs", lambda: single("tdrs", 300.0)),
    "TDRS, 1 km": ("tdrs", lambda: single("tdrs", 1000.0)),
    "TDRS, 3 km": ("tdrs", lambda: single("tdrs", 3000.0)),
    "ISS, 500 m": ("iss", lambda: single("iss", 500.0)),
    "ten TDRS, 3 km": ("tdrs", lambda: fleet("tdrs", 10, columns=5, spacing_m=24.0)),
    "ten craft, 0.3 to 3 km": ("iss", crowd),
    "ground, 300 m": ("tdrs", ground),
}


def available() -> list[str]:
    """Return the names of the scenes whose mesh is here, and say which are not."""
    there = []
    for name, (model, _) in SCENES.items():
        if has(model):
            there.append(name)
        else:
            print(
                f"skipped: {name}: no mesh {model}.stl; RSO_LIDAR_SHARED names the folder that holds meshes/{model}.stl"
            )
    return there


def build(name: str) -> rl.Scenario:
    """Return the scenario of a scene by name."""
    return SCENES[name][1]()
