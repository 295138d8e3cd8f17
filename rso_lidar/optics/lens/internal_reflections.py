"""Ghost images: faint copies of the image that reflections inside the lens make."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from rso_lidar.part import NotNegative, Number, Part, Positive

PixelPair = tuple[Number, Number]


class Ghost(Part):
    """Faint copy of the whole image, from light that two surfaces of the lens or the focal plane reflect.

    A ghost of a lens that is symmetric about its axis is turned by 180 degrees about that axis. This is the default;
    `mirror_pixels` gives another point. A tilted window or filter shifts the copy instead: give `offset_pixels`. A ghost
    out of focus spreads each point evenly over a disc of `defocus_um`. Laser light and sunlight have the same ghosts.

    The copy takes no light from the image: `transmission` states what the image gets, and the ghost is part of what the
    lens loses. `fraction` relates its light to the light of the image. Two surfaces of reflectance r give r², so 2.5e-5
    for 0.5 % each (Fresnel), and 1e-3 for a coated surface before a focal plane that reflects 20 %.
    """

    fraction: Annotated[Positive, Field(le=0.5)] = Field(
        description="Light of the ghost over the light of the image: the product of the two reflectances."
    )
    mirror_pixels: PixelPair | None = Field(
        default=None,
        description=(
            "Point of the focal plane about which the copy is turned by 180 degrees, as column and row from the outer "
            "corner of the first pixel [pixels]. If omitted, the optical axis."
        ),
    )
    offset_pixels: PixelPair | None = Field(
        default=None,
        description="Shift of an upright copy to the right and down [pixels], instead of `mirror_pixels`.",
    )
    defocus_um: NotNegative = Field(
        default=0.0, description="Radius of the disc of a point that is out of focus [µm]. Default: a choice, in focus."
    )
    extra_path_m: NotNegative = Field(
        default=0.0,
        description=(
            "Detour of the light inside the lens, there and back, by which it arrives later [m]. Default: a choice; a few "
            "centimetres are far below the length of a pulse."
        ),
    )

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        if self.mirror_pixels is not None and self.offset_pixels is not None:
            raise ValueError("give one of mirror_pixels (a copy that is turned) and offset_pixels (an upright copy)")
        if self.offset_pixels == (0.0, 0.0) and self.defocus_um == 0.0 and self.extra_path_m == 0.0:
            raise ValueError("offset_pixels [0, 0] in focus lays the copy on the image; give an offset or a defocus_um")
        return self

    @property
    def is_turned(self) -> bool:
        """Whether the copy is turned by 180 degrees."""
        return self.offset_pixels is None

    def shift_pixels(self, shape: tuple[int, int]) -> tuple[float, float]:
        """Return the shift of the copy down and right [pixels], after a turn about the middle of the array if it is turned.

        Parameters
        ----------
        shape : rows and columns of the focal plane
        """
        rows, cols = shape
        if self.offset_pixels is not None:
            return self.offset_pixels[1], self.offset_pixels[0]
        col, row = self.mirror_pixels or (0.5 * cols, 0.5 * rows)
        return 2.0 * row - rows, 2.0 * col - cols
