"""Mission: the tables of a scenario file joined and checked against one another."""

from __future__ import annotations

import datetime
from contextlib import AbstractContextManager
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from rso_lidar.errors import ScenarioError, add_place, suppress_warnings
from rso_lidar.files import convert_path
from rso_lidar.imaging import Camera, NaturalLight
from rso_lidar.motion import Body, Ptu, find_moon_m, sort_bodies
from rso_lidar.optics import read_files
from rso_lidar.orbit import Epochs
from rso_lidar.part import Part, Text, Whole, python_objects
from rso_lidar.scenario.mission.exposure import Exposure
from rso_lidar.scenario.mission.moon_missions import check_lunar_orbits
from rso_lidar.scenario.mission.named_files import find_named_files, list_dynamics, list_fmus
from rso_lidar.scenario.mission.sensor_checks import check_cameras, check_sensors, check_tracked_name
from rso_lidar.scenario.mission.surface_forces import bind_facets
from rso_lidar.scenario.mission.target_surfaces import build_surfaces
from rso_lidar.scenario.mission.validation import read_toml, validate_tables, validate_toml
from rso_lidar.scenario.tables.constraints import Constraints
from rso_lidar.scenario.tables.dispersion import Dispersion
from rso_lidar.scenario.tables.finding import Finding
from rso_lidar.scenario.tables.lidar import Lidar, check_instrument
from rso_lidar.scenario.tables.link import DataLink
from rso_lidar.scenario.tables.target import Follower, Target
from rso_lidar.scenario.tables.world import Time, World
from rso_lidar.scene import Surface
from rso_lidar.sensors import AnySensor
from rso_lidar.shipped import find
from rso_lidar.user_settings import is_trusted

_WITHOUT_NOISE = (
    "bodies",
    "pan_tilt",
    "surfaces",
    "instrument",
    "exposure",
    "cameras",
    "camera_surfaces",
)  # cached, and the same for every seed


class Mission(Part):
    """Everything that a simulation needs, as its TOML file says it, with the files that it names found.

    Relative paths are looked up beside the scenario file, then among the shipped data.
    """

    version: Literal[1] = Field(description="Version of the file format.")
    name: Text = Field(description="Title of the mission.")
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = Field(
        default=0, description="Random seed of all noise; frame k depends on (seed, k) only."
    )
    world: World = Field(default=World(), description="Root axes, and whether light takes time.")
    time: Time = Field(description="Start, duration and frame rate.")
    target: tuple[Target, ...] = Field(default=(), description="Targets that may be seen; there may be none.")
    follower: Follower = Field(description="Spacecraft that carries the lidar.")
    ptu: Ptu | None = Field(
        default=None, description="Pan-tilt unit. If omitted, the lidar looks along the follower's +x."
    )
    lidar: Lidar = Field(description="Instrument.")
    camera: tuple[Camera, ...] = Field(
        default=(), description="Cameras beside the lidar, which take an image with every laser flash."
    )
    sensor: tuple[AnySensor, ...] = Field(
        default=(), description="Other sensors of the follower, whose samples reach a controller with the next flash."
    )
    link: DataLink | None = Field(
        default=None,
        description="Delays and losses between the instrument and flight software, for `serve`; none if omitted. A run does "
        "not use it.",
    )
    constraints: Constraints | None = Field(
        default=None,
        description="Limits that `check` verifies: exclusion angles, keep-out spheres and approach corridors.",
    )
    finding: Finding = Field(
        default=Finding(),
        description="When a target counts as found, for `check`, `timeline`, `budget` and `trade`. A run does not use it.",
    )
    dispersion: Dispersion | None = Field(default=None, description="Errors that `disperse` applies. A run uses none.")
    _folder: Path | None = PrivateAttr(default=None)
    _where: str = PrivateAttr(default="scenario")
    _trust_code: bool | None = PrivateAttr(default=True)
    _trust_fmu: bool = PrivateAttr(default=False)

    @classmethod
    def load(
        cls, path: str | Path, settings: tuple[str, ...] = (), *, trust_code: bool = False, trust_fmu: bool = False
    ) -> Self:
        """Load a scenario from a TOML file.

        Parameters
        ----------
        path : of the file; a relative one is looked up in the working folder, then among the shipped data
        settings : fields to change, such as ``"lidar.laser.energy_mj=20"``
        trust_code, trust_fmu : whether Python code (`dynamics`) and FMUs that the file names may run when it is flown.
            Otherwise such a scenario can be read but not flown, unless the file is in a folder that the user's settings
            trust (`rso-lidar config set trust_code FOLDER`)

        Raises
        ------
        ScenarioError
            For a file that cannot be read, and for content that is not a valid scenario.
        """
        path = convert_path(path, ScenarioError)
        path = find(path) or path
        text, where = read_toml(path), path.name
        trust_code, trust_fmu = (
            given or is_trusted(key, path) for key, given in (("trust_code", trust_code), ("trust_fmu", trust_fmu))
        )
        scenario = cls.loads(text, folder=path.parent, where=where, settings=settings, trust_code=trust_code)
        return scenario.with_trusted_fmus() if trust_fmu else scenario

    @classmethod
    def loads(
        cls,
        text: str,
        *,
        folder: Path | None = None,
        where: str = "scenario",
        settings: tuple[str, ...] = (),
        trust_code: bool | None = False,
    ) -> Self:
        """Load a scenario from a TOML text, such as that of a recording.

        Parameters
        ----------
        text : the TOML
        folder : start of relative paths (None: the working folder)
        where : name of the text in error messages
        settings : fields to change, such as ``"lidar.laser.energy_mj=20"``
        trust_code : whether Python code that the text names as `dynamics` may run when the scenario is flown. Otherwise
            such a scenario can be read but not flown. None for the text of a recording, whose code never runs

        Raises
        ------
        ScenarioError
            For a text that is not a valid scenario.
        """
        scenario = validate_toml(cls, text, where, settings, folder=folder)
        scenario._folder, scenario._where, scenario._trust_code = folder, where, trust_code
        return scenario

    @classmethod
    def from_tables(
        cls, tables: dict[str, Any], *, folder: Path | None = None, where: str = "scenario", trust_code: bool = False
    ) -> Self:
        """Build a scenario from the tables of a TOML text, for those that make many of one.

        Parameters
        ----------
        tables : by key, as TOML gives them
        folder : start of relative paths (None: the working folder)
        where : name of the scenario in error messages
        trust_code : as in `loads`

        Raises
        ------
        ScenarioError
            For tables that are not a valid scenario.
        """
        scenario = validate_tables(cls, tables, where, folder)
        scenario._folder, scenario._where, scenario._trust_code = folder, where, trust_code
        return scenario

    def __eq__(self, other: object) -> bool:
        """Compare the content of two scenarios, wherever their files are."""
        return (
            isinstance(other, Mission)
            and self.model_dump() == other.model_dump()
            and python_objects(self) == python_objects(other)
        )

    __hash__ = None  # type: ignore[assignment]

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed, validated like a new scenario."""
        changed = super().replace(**changes)
        changed._folder, changed._where = self._folder, self._where
        changed._trust_code, changed._trust_fmu = self._trust_code, self._trust_fmu
        return changed

    def with_trusted_fmus(self) -> Self:
        """Return the scenario with its FMUs trusted: their native code runs when it is flown."""
        changed = self.replace()
        changed._trust_fmu = True
        return changed

    def with_seed(self, seed: int) -> Self:
        """Return the scenario with another seed; files that have been read are not read again.

        Parameters
        ----------
        seed : of all noise
        """
        changed = self.replace(seed=seed)
        known = {name: self.__dict__[name] for name in _WITHOUT_NOISE if name in self.__dict__}
        if any(hasattr(body.motion, "with_seed") for body in (*self.target, self.follower)):
            known.pop("bodies", None)
        changed.__dict__.update(known)
        return changed

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        bodies: list[Body] = [*self.target, self.follower]
        sort_bodies(bodies, local=self.is_local)
        if self.constraints is not None:
            sun = not self.is_local or self.world.sun_direction is not None
            self.constraints.check(self.target, local=self.is_local, sun=sun)
        if self.lidar.exposure_s * self.time.frame_rate_hz >= 1.0:
            raise ValueError(
                f"lidar.laser.pulse_rate_hz: {self.lidar.detector.traits.pulses} pulses at "
                f"{self.lidar.laser.pulse_rate_hz:g} Hz take {self.lidar.exposure_s:.3g} s, and frames follow each other "
                f"after {1.0 / self.time.frame_rate_hz:.3g} s; raise it, or lower the pulses of the detector or "
                "time.frame_rate_hz"
            )
        check_sensors(self.sensor, self.target, self.follower)
        check_cameras(self.camera, bodies, has_ptu=self.ptu is not None)
        check_lunar_orbits(bodies, self.world, self.lidar, self.sensor, self.dispersion)
        receiver = self.lidar.receiver
        if self.finding.pixels > receiver.n_rows * receiver.n_cols:
            raise ValueError(
                f"finding.pixels: {self.finding.pixels} is more than the {receiver.n_rows * receiver.n_cols} pixels of the "
                "receiver, so no target could be found; lower it"
            )
        check_tracked_name(None if self.ptu is None else self.ptu.point.tracked_name, bodies)
        return self

    @property
    def folder(self) -> Path | None:
        """Folder in which relative paths start; None for the working folder."""
        return self._folder

    @property
    def is_local(self) -> bool:
        """Whether the root axes have no Earth."""
        return self.world.axes == "local"

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Targets and follower, with the paths of their motions' files; refused where code of theirs is not trusted."""
        for body in (*self.target, self.follower):
            for place in ("motion", "attitude"):
                with self.locate_errors(f"{body.name}.{place}"):
                    self._check_code(getattr(body, place))
        return self.located_bodies

    @cached_property
    def located_bodies(self) -> tuple[Body, ...]:
        """The bodies, for what asks of their motions without flying them."""
        return tuple(self._find_files_of(body) for body in (*self.target, self.follower))

    def _find_files_of(self, body: Body) -> Body:
        changes = {}
        for place in ("motion", "attitude"):
            if (part := getattr(body, place)) is None:
                continue
            with self.locate_errors(f"{body.name}.{place}"):
                resolved_part = find_named_files(part, self.file)
                if (check := getattr(resolved_part, "check", None)) is not None:
                    check(self.time.start_utc)  # a bad element set is an error now, with its place
            if (seeded := getattr(resolved_part, "with_seed", None)) is not None:
                resolved_part = seeded(self.seed_of(body.name))
            if resolved_part is not part:
                changes[place] = resolved_part
        body = body.replace(**changes) if changes else body
        with self.locate_errors(body.name):
            changes = bind_facets(body, self.file, self.lidar.laser.wavelength_m)
        return body.replace(**changes) if changes else body

    @cached_property
    def pan_tilt(self) -> Ptu | None:
        """PTU with the paths of the files that it names."""
        with self.locate_errors("ptu"):
            self._check_code(self.ptu)
            ptu: Ptu | None = find_named_files(self.ptu, self.file) if self.ptu else None
        return ptu

    def _check_code(self, part: Any) -> None:
        """Raise `ScenarioError` for a part that names Python code or an FMU, unless it is trusted."""
        fmus = [] if self._trust_fmu else list_fmus(part)
        code = [] if self._trust_code else list_dynamics(part)
        if not (fmus or code):
            return
        what = f"the FMU '{fmus[0]}' holds native code" if fmus else f"dynamics: names the Python code '{code[0]}'"
        option = "fmu" if fmus else "code"
        cure = (
            f"runs only where it is trusted; give --trust-{option}, in Python trust_{option}=True, or trust its folder with "
            f"`rso-lidar config set trust_{option} FOLDER`"
        )
        if self._trust_code is None:
            cure = "never runs from a recording; take a recording of other motions"
        raise ScenarioError(f"{what}, which {cure}")

    def locate_errors(self, place: str = "") -> AbstractContextManager[None]:
        """Return a context that prefixes the messages of errors with the scenario's name and a place in it.

        Parameters
        ----------
        place : dotted key, such as ``follower.motion``; empty for the scenario as a whole
        """
        return add_place(f"{self._where}: {place}" if place else self._where)

    def file(self, name: str) -> Path:
        """Find a file that the scenario names: beside the scenario, then among the shipped data.

        Parameters
        ----------
        name : as the scenario states it

        Returns
        -------
        Path

        Raises
        ------
        ScenarioError
            If there is no such file.
        """
        path = find(name, self._folder)
        if path is None:
            beside = (
                f"beside the scenario ({self._folder})" if str(self._folder or ".") != "." else "in the working folder"
            )
            raise ScenarioError(f"no file '{name}' {beside} nor among the shipped data; check the name")
        return path

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """Surfaces of the targets: meshes in body axes, with materials. Each hinge carries a surface of its own."""
        return self.build_surfaces()

    def build_surfaces(self) -> tuple[Surface, ...]:
        """Build `surfaces`, and give the warnings of their construction, also where they were built before."""
        return self._build_surfaces(self.lidar.laser.wavelength_m)

    def _build_surfaces(self, wavelength_m: float, place: str = "") -> tuple[Surface, ...]:
        """Build the surfaces of all targets as light of a wavelength [m] sees them; `place` is named in errors."""
        surfaces: list[Surface] = []
        for number, target in enumerate(self.target):
            with self.locate_errors(f"{place}target {target.name}"):
                surfaces += build_surfaces(target, number, self.file, wavelength_m)
        return tuple(surfaces)

    @cached_property
    def cameras(self) -> tuple[Camera, ...]:
        """Cameras with the paths of the files that they name."""
        cameras = []
        for camera in self.camera:
            with self.locate_errors(f"camera {camera.name}"):
                cameras.append(find_named_files(camera, self.file))
                read_files(camera.lens.even_light, cameras[-1].lens)
        return tuple(cameras)

    @cached_property
    def camera_surfaces(self) -> dict[str, tuple[tuple[Surface, ...], ...]]:
        """Surfaces of the targets as each band of each camera sees them, by the camera's name."""
        with suppress_warnings():  # those of the meshes have been given
            return {
                camera.name: tuple(
                    self._build_surfaces(band.wavelength_m, f"camera {camera.name}, band {band.name}: ")
                    for band in camera.bands
                )
                for camera in self.camera
            }

    def surfaces_of(self, number: int) -> tuple[Surface, ...]:
        """Return the surfaces of one target: that of its body, then those of its hinges.

        Parameters
        ----------
        number : index of the target
        """
        return tuple(surface for surface in self.surfaces if surface.target == number)

    def corners_of(self, number: int) -> np.ndarray:
        """Return the corners (facet, 3, xyz) f8 [m] of one target in body axes, with all hinges at zero.

        Parameters
        ----------
        number : index of the target
        """
        seats = [(0.0, 0.0, 0.0), *(joint.position_m for joint in self.target[number].joints)]
        surfaces = self.surfaces_of(number)
        return np.concatenate([surface.corners + np.array(at) for surface, at in zip(surfaces, seats, strict=True)])

    @cached_property
    def instrument(self) -> Lidar:
        """Lidar with the paths of the files that it names, all of them read."""
        with self.locate_errors("lidar"):
            lidar: Lidar = find_named_files(self.lidar, self.file)
            check_instrument(lidar)
        return lidar

    @property
    def span(self) -> tuple[datetime.datetime, float]:
        """Start in UTC, and time of the last pulse of the last frame [s since start_utc]."""
        return self.time.start_utc, (self.time.n_frames - 1) / self.time.frame_rate_hz + self.lidar.exposure_s

    @cached_property
    def exposure(self) -> Exposure | None:
        """Pulses of a frame, between which targets, follower and PTU move; None where all are sent at once."""
        if self.lidar.exposure_s == 0.0:
            return None
        return Exposure(self.lidar.detector.traits.pulses, self.lidar.exposure_s, self.surfaces)

    def epochs(self, frames: np.ndarray | None = None) -> Epochs:
        """Return the epochs of frames: of their only pulse, or the middle of their exposure, which begins at `time.seconds`.

        Parameters
        ----------
        frames : indices of frames (time); by default all
        """
        numbers = np.arange(self.time.n_frames) if frames is None else frames
        return Epochs(self.time.start_utc, self.time.seconds(numbers) + 0.5 * self.lidar.exposure_s)

    def moon_position_m(self, time_s: float) -> np.ndarray | None:
        """Return the position of the Moon (xyz) in inertial axes [m]; None where there is none, or no glare of it.

        Parameters
        ----------
        time_s : time [s since start_utc]
        """
        glare = self.lidar.receiver.glare
        if glare is None or "moon" not in glare.sources:
            return None
        return self._find_moon_m(time_s)

    def _find_moon_m(self, time_s: float) -> np.ndarray | None:
        if self.is_local:
            return None
        position_m: np.ndarray = find_moon_m(self.bodies, Epochs(self.time.start_utc, np.array([time_s])))[0]
        return position_m

    def find_natural_light(self, time_s: float) -> NaturalLight:
        """Find what lights the images of cameras beside the Sun.

        Parameters
        ----------
        time_s : time [s since start_utc]

        Returns
        -------
        NaturalLight
        """
        return NaturalLight(self.world.earth_albedo, self._find_moon_m(time_s), has_earth=not self.is_local)

    def rng(self, frame: int, stage: int = 0) -> np.random.Generator:
        """Return the generator of one frame's noise: it depends on seed, frame and stage only.

        Parameters
        ----------
        frame : index of the frame
        stage : number that separates the noise of detection and of pointing
        """
        return np.random.Generator(np.random.Philox(np.random.SeedSequence(self.seed, spawn_key=(frame, stage))))

    def seed_of(self, name: str) -> int:
        """Return the seed of the own errors of a body, from that of the scenario and a name.

        Parameters
        ----------
        name : of the body
        """
        state = np.random.SeedSequence([self.seed, *name.encode()]).generate_state(1, np.uint64)
        return int(state[0] >> np.uint64(1))
