"""Lines of scenario files that are written for encounters."""

from rso_lidar.mission_analysis.passes.scenario_lines import write_cautions


def test_cautions_are_of_what_is_nearer_or_farther_than_the_lidar_sees_and_faster_than_the_drive():
    def tell(range_m, slew_deg_s):
        return [line.partition(": ")[2] for line in write_cautions(range_m, (100.0, 8089.0), slew_deg_s, 2.0)]

    assert tell(100.0, 2.0) == tell(8089.0, 0.0) == []
    (near,) = tell(99.0, 0.0)
    assert near.startswith(
        "the closest approach is outside the lidar's reach (100 to 8,089 m for a facing plate of 1 m2)"
    )
    assert tell(8090.0, 0.0) == [near]
    (fast,) = tell(500.0, 12.345)
    assert fast == "the line of sight turns at 12.3 deg/s at the closest approach, more than the 2 deg/s of the drive."
