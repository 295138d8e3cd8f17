"""The plan of a sequence: that of the whole, and a table of its legs."""

from __future__ import annotations

from dataclasses import dataclass

from rso_lidar.rpo.plans.plan import Plan, format_length, format_rows


@dataclass(frozen=True)
class PlannedLeg:
    """One leg of a planned sequence, with the transfer to its start.

    Parameters
    ----------
    name : its operation
    begin_s : when the last leg ended and the transfer begins [s]
    arrival_s : when the transfer ends and the operation begins [s]; `begin_s` without a transfer
    end_s : end of the leg [s]
    ended_by : the condition that ended it, or "plan" for its own end
    delta_v_m_s : its impulses and continuous thrust [m/s]. An impulse between two legs belongs to the later one, if that
        needs a velocity other than the one with which the earlier operation ends
    nearest_m : least distance to the body [m]
    """

    name: str
    begin_s: float
    arrival_s: float
    end_s: float
    ended_by: str
    delta_v_m_s: float
    nearest_m: float


@dataclass(frozen=True, eq=False)
class SequencePlan(Plan):
    """A plan of several legs, one after the other.

    Parameters
    ----------
    parts : the legs of the sequence; `legs` are the stretches of their paths
    """

    parts: tuple[PlannedLeg, ...] = ()

    def leg_table(self) -> tuple[tuple[str, ...], ...]:
        """Return the legs as rows of text under a heading."""
        heading = ("leg", "operation", "begin_s", "arrival_s", "end_s", "ended_by", "delta_v_m_s", "nearest")
        rows = [
            (
                str(k),
                part.name,
                f"{part.begin_s:.1f}",
                f"{part.arrival_s:.1f}",
                f"{part.end_s:.1f}",
                part.ended_by,
                f"{part.delta_v_m_s:.5f}",
                format_length(part.nearest_m),
            )
            for k, part in enumerate(self.parts)
        ]
        return (heading, *rows)

    def describe(self) -> str:
        """Return the plan as lines of text: the legs, maneuvers, totals, least distance and passive safety."""
        first, *others = super().describe().splitlines()
        return "\n".join([first, *format_rows(self.leg_table()), *others])
