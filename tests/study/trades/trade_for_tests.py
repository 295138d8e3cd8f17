"""A small study of a plate on a bench, for tests of trades."""

STUDY = """
version  = 1
name     = "Energy and beam"
scenario = "bench.toml"
frames   = "0:4:2"
merits   = ["detection_fraction", "range_error_m", "time_in_field_s"]

[[axis]]
field  = "lidar.laser.energy_mj"
values = [5, 20]

[[axis]]
field  = "lidar.laser.divergence_deg"
low    = 1.0
high   = 4.0
count  = 3
scale  = "log"
"""


def folder_with(tmp_path, bench, study=STUDY):
    """Return the path of a study beside its scenario."""
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(study, encoding="utf-8")
    return path
