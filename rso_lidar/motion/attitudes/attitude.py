"""All attitudes of a scenario, as one annotated field that also accepts a user-defined object."""

from typing import Annotated

from pydantic import BeforeValidator, Field

from rso_lidar.motion.attitudes.attitude_dynamics import StateSpaceAttitude
from rso_lidar.motion.attitudes.fmu_attitude import FmuAttitude
from rso_lidar.motion.attitudes.law import Law, refuse_bare_lvlh
from rso_lidar.motion.attitudes.situation import Attitude
from rso_lidar.motion.attitudes.slew import Slew
from rso_lidar.part import Seam

DescribedAttitude = Annotated[
    Annotated[Law | Slew | StateSpaceAttitude | FmuAttitude, Field(discriminator="type")],
    BeforeValidator(refuse_bare_lvlh),
]
AnyAttitude = Annotated[DescribedAttitude | Attitude, Seam(DescribedAttitude, Attitude)]
