"""Attitude of a frame by SPICE kernels."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.orbit import read_spice_attitude
from rso_lidar.part import Part, Text


class SpiceAttitude(Part):
    """Attitude of a frame by SPICE kernels of the user: a CK with its clock (SCLK) and frame (FK).

    Requires the extra `spice`. The axes of the frame are those of the body, relative to the toolkit's J2000 axes, which are
    those of ICRF. The CK has angular velocities.
    """

    type: Literal["spice"] = "spice"
    kernels: Annotated[tuple[Text, ...], Field(min_length=1)] = Field(
        description="Paths of the kernels, in the order in which they are loaded; later ones have priority."
    )
    frame: Text = Field(description="Name of the frame, such as 'FOLLOWER_BODY'.")

    def orient(self, situation: Situation) -> Orientation:
        """Interpolate the attitude of the body.

        Returns
        -------
        attitude and body rates in root axes

        Raises
        ------
        PropagationError
            If the kernels have no attitude at an epoch
        ScenarioError
            If a kernel cannot be read, or the extra is not installed
        """
        from scipy.spatial.transform import Rotation

        turned, rate = read_spice_attitude(self.kernels, self.frame, situation.epochs)
        return Orientation(Rotation.from_matrix(turned), rate)
