"""The receiver: a lens and the focal plane behind it, with their geometry and their light-gathering power."""

import math
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.optics.lens.distortion import Distortion
from rso_lidar.optics.lens.internal_reflections import Ghost
from rso_lidar.optics.lens.psf import Psf
from rso_lidar.optics.lens.surface_scatter import Glare
from rso_lidar.part import Count, Part, Positive, Whole

FieldOfView = Annotated[Positive, Field(lt=180)]
Transmission = Annotated[Positive, Field(le=1)]
_GRID_SIDE = 4  # rays along each side of a pixel in a grid without contours


class Receiver(Part):
    """Lens that images the scene onto a focal plane of square pixels (Fuller et al., sec. 3.1.4).

    Give `fov_deg` (full angle across the columns) or `focal_length_mm`, and `f_number` or `aperture_mm`. Rays sample the
    area of each pixel along lines that edges of targets cut, as many as `sampling_error` needs. With `rays_per_pixel` = k²
    they are a fixed k x k grid, and edges cut its lines only for targets that would get fewer than `min_rays_per_target`.

    `psf` spreads light over pixels and `distortion` bends the image; without them the lens is perfect.
    `filter_width_nm` is the width of the spectral filter about the laser's line. With a filter, sunlight on the targets
    reaches the detector. `ghosts` and `glare` are stray light, off by default.
    """

    fov_deg: FieldOfView | None = Field(
        default=None,
        description="Full field of view across the columns [deg]; give exactly one of this and `focal_length_mm`.",
    )
    focal_length_mm: Positive | None = Field(
        default=None, description="Focal length of the lens [mm]; give exactly one of this and `fov_deg`."
    )
    f_number: Positive | None = Field(
        default=None, description="Focal length over aperture; give exactly one of this and `aperture_mm`."
    )
    aperture_mm: Positive | None = Field(
        default=None, description="Aperture diameter [mm]; give exactly one of this and `f_number`."
    )
    transmission: Transmission = Field(
        default=0.67,
        description=(
            "Transmission of the whole optical path, out and back. Default: derived in docs/physics.md from the range "
            "and detection that Fuller et al. give; not published."
        ),
    )
    n_rows: Count = Field(default=128, description="Number of pixel rows. Default: Fuller et al., sec. 3.3.")
    n_cols: Count = Field(default=128, description="Number of pixel columns. Default: Fuller et al., sec. 3.3.")
    pixel_pitch_um: Positive = Field(
        default=100.0,
        description="Pitch of the square pixels, which have no gaps [µm]. Default: Fuller et al., sec. 3.1.4.",
    )
    sampling_error: Annotated[Positive, Field(ge=1e-4, le=1)] = Field(
        default=0.02,
        description=(
            "Required relative error (rms) of the pixels' expected photons, weighted by their light over the frame, "
            "because rays sample the pixels' areas. An error below a third of a pixel's photon noise does not count. There "
            "are at most two rounds of rays, so a frame may stay above it; the label `photons_sampling_error` has the error "
            "of each pixel. Default: a choice of sampling, not of physics."
        ),
    )
    rays_per_pixel: Count | None = Field(
        default=None,
        description=(
            "Fixed number of rays per pixel, a square number k × k: k lines with k rays each; 1 is a ray through the "
            "centre. If omitted, the number follows from `sampling_error`."
        ),
    )
    min_rays_per_target: Annotated[Whole, Field(ge=0, le=1_000_000)] = Field(
        default=4096,
        description=(
            "With `rays_per_pixel`: minimum number of rays over the bounds of a target. With fewer, the target's edges cut "
            "the lines of rays as well. 0 disables it. Default: a choice of sampling, not of physics."
        ),
    )
    psf: Psf | None = Field(
        default=None, description="Point spread function of the lens. If omitted, light stays in its pixel."
    )
    distortion: Distortion | None = Field(
        default=None, description="Distortion of the lens. If omitted, an ideal pinhole."
    )
    filter_width_nm: Positive | None = Field(
        default=None,
        description=(
            "Width of the spectral filter about the laser's line [nm]. If given, sunlight reflected by the targets "
            "adds background."
        ),
    )
    ghosts: tuple[Ghost, ...] = Field(
        default=(), max_length=16, description="Ghost images of the lens. Default: a choice, none."
    )
    glare: Glare | None = Field(
        default=None,
        description=(
            "Sun, lit Earth and Moon in the field of view, and their light that the lens scatters. If omitted, only light "
            "of targets is imaged. Needs `filter_width_nm`."
        ),
    )

    @model_validator(mode="after")
    def _check_pairs(self) -> Self:
        if (self.fov_deg is None) == (self.focal_length_mm is None):
            raise ValueError("give exactly one of fov_deg and focal_length_mm")
        if (self.f_number is None) == (self.aperture_mm is None):
            raise ValueError("give exactly one of f_number and aperture_mm")
        if self.n_rows * self.n_cols * self.rays_per_side**2 > 2**27:
            raise ValueError("n_rows * n_cols * rays_per_pixel is over 134 million rays; give fewer")
        if self.rays_per_pixel is not None and math.isqrt(self.rays_per_pixel) ** 2 != self.rays_per_pixel:
            near = max(1, round(math.sqrt(self.rays_per_pixel))) ** 2
            raise ValueError(
                f"rays_per_pixel is a k x k grid; give a square number, {near} instead of {self.rays_per_pixel}"
            )
        self._check_stray_light()
        return self

    def _check_stray_light(self) -> None:
        """Refuse ghosts that never land on the focal plane, glare without a filter, and a baffle in the field's way."""
        for number, ghost in enumerate(self.ghosts):
            reach = ghost.defocus_um / self.pixel_pitch_um
            if reach > 2 * max(self.shape):
                raise ValueError(
                    f"ghosts[{number}].defocus_um: is a disc of {reach:.3g} pixels in radius, over twice the focal plane; "
                    "reduce it"
                )
            shift = ghost.shift_pixels(self.shape)
            if any(abs(by) >= n + reach + 1 for by, n in zip(shift, self.shape, strict=True)):
                raise ValueError(
                    f"ghosts[{number}]: lies {max(abs(by) for by in shift):.4g} pixels away, beside the focal plane of "
                    f"{self.n_rows} x {self.n_cols} pixels; correct its place or leave it out"
                )
        if self.glare is None:
            return
        if self.filter_width_nm is None:
            raise ValueError("glare needs filter_width_nm, which says how much of the Sun's spectrum passes; give it")
        baffle = self.glare.baffle
        if baffle is not None:
            slope = math.hypot(*self.field_edge)
            least_mm = self.aperture_m / units.MM + 2.0 * slope * baffle.length_mm
            if baffle.diameter_mm < least_mm * (1.0 - 1e-9):
                raise ValueError(
                    f"glare.baffle.diameter_mm ({baffle.diameter_mm:g}) cuts into the field of view: a baffle of "
                    f"{baffle.length_mm:g} mm needs {least_mm:.4g} mm; widen or shorten it"
                )

    @property
    def has_stray_light(self) -> bool:
        """Whether ghosts or glare are simulated."""
        return bool(self.ghosts) or self.glare is not None

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the focal plane."""
        return self.n_rows, self.n_cols

    @property
    def rays_per_side(self) -> int:
        """Side k of the fixed k x k grid of rays in a pixel; 4 if `rays_per_pixel` is omitted."""
        return _GRID_SIDE if self.rays_per_pixel is None else math.isqrt(self.rays_per_pixel)

    @cached_property
    def pixel_pitch_m(self) -> float:
        """Pixel pitch [m]."""
        return self.pixel_pitch_um * units.UM

    @cached_property
    def focal_length_m(self) -> float:
        """Focal length [m]; from the field of view it is width / (2 tan(FoV/2))."""
        if self.focal_length_mm is not None:
            return self.focal_length_mm * units.MM
        assert self.fov_deg is not None
        return 0.5 * self.n_cols * self.pixel_pitch_m / math.tan(0.5 * self.fov_deg * units.DEG)

    @cached_property
    def aperture_m(self) -> float:
        """Diameter of the aperture [m]."""
        if self.aperture_mm is not None:
            return self.aperture_mm * units.MM
        assert self.f_number is not None
        return self.focal_length_m / self.f_number

    @cached_property
    def aperture_area_m2(self) -> float:
        """Area of the aperture [m²]."""
        return 0.25 * math.pi * self.aperture_m**2

    @cached_property
    def fov_rad(self) -> float:
        """Full field of view across the columns [rad]."""
        return 2.0 * math.atan(0.5 * self.n_cols * self.pixel_tangent)

    @cached_property
    def pixel_tangent(self) -> float:
        """Width of a pixel in the tangent plane at unit distance: pitch / focal length."""
        return self.pixel_pitch_m / self.focal_length_m

    @cached_property
    def ifov_rad(self) -> float:
        """Instantaneous field of view of a pixel on the boresight [rad]."""
        return 2.0 * math.atan(0.5 * self.pixel_tangent)

    def image_of(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the image of directions on the focal plane.

        Parameters
        ----------
        x, y : tangents of the directions (x, y, 1) in lidar axes

        Returns
        -------
        column and row, 0 at the outer edges of the first pixels.
        """
        if self.distortion is not None:
            x, y = self.distortion.distort(x, y)
        return x / self.pixel_tangent + 0.5 * self.n_cols, y / self.pixel_tangent + 0.5 * self.n_rows

    def tangents_at(self, col: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions that the lens images to points of the focal plane; the inverse of `image_of`.

        Parameters
        ----------
        col, row : points, 0 at the outer edges of the first pixels

        Returns
        -------
        x and y of the directions (x, y, 1) in lidar axes.
        """
        x = (col - 0.5 * self.n_cols) * self.pixel_tangent
        y = (row - 0.5 * self.n_rows) * self.pixel_tangent
        return (x, y) if self.distortion is None else self.distortion.undistort(x, y)

    @cached_property
    def field_edge(self) -> np.ndarray:
        """Greatest |x| and |y| (right_down) of directions (x, y, 1) that the focal plane sees."""
        col = np.concatenate([np.linspace(0.0, self.n_cols, 65)] * 2 + [np.zeros(65), np.full(65, float(self.n_cols))])
        down = np.linspace(0.0, self.n_rows, 65)
        row = np.concatenate([np.zeros(65), np.full(65, float(self.n_rows)), down, down])
        edge: np.ndarray = np.abs(np.stack(self.tangents_at(col, row))).max(axis=1)
        return edge

    @cached_property
    def line_of_sight(self) -> np.ndarray:
        """Unit vectors (row, col, xyz) of the pixels' centres in lidar axes, distortion included."""
        centres = np.broadcast_arrays((np.arange(self.n_cols) + 0.5)[None, :], (np.arange(self.n_rows) + 0.5)[:, None])
        ray = np.stack([*self.tangents_at(*centres), np.ones(self.shape)], axis=-1)
        ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
        ray.flags.writeable = False
        return ray
