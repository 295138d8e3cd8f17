"""Attitude laws between which a slew may lead: all attitudes except slews and integrated ones."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from rso_lidar.motion.attitudes.attitude_hold import FixedAttitude, LvlhCcsds, Rtn
from rso_lidar.motion.attitudes.attitude_table import AttitudeTable
from rso_lidar.motion.attitudes.kernel_attitude import SpiceAttitude
from rso_lidar.motion.attitudes.look_at import LookAt
from rso_lidar.motion.attitudes.situation import Attitude
from rso_lidar.motion.attitudes.spin import Spin, Tumble
from rso_lidar.motion.attitudes.sun_pointing import Nadir, SunPointing
from rso_lidar.part import Seam


def refuse_bare_lvlh(table: Any) -> Any:
    """Refuse the ambiguous type "lvlh" of an attitude, and return any other table as it is."""
    tag = table.get("type") if isinstance(table, dict) else None
    if tag in ("lvlh", "LVLH"):
        raise ValueError(
            "'lvlh' means two things; write 'rtn' (x radially out, z along the orbit normal) "
            "or 'lvlh_ccsds' (z to nadir, y against the orbit normal)"
        )
    return table


Law = FixedAttitude | Rtn | LvlhCcsds | LookAt | Spin | Tumble | SunPointing | Nadir | AttitudeTable | SpiceAttitude
DescribedLaw = Annotated[Annotated[Law, Field(discriminator="type")], BeforeValidator(refuse_bare_lvlh)]
AnyLaw = Annotated[DescribedLaw | Attitude, Seam(DescribedLaw, Attitude)]
