"""Write the synthetic element sets of this folder, and the index of all that lies here: `python tle/make_synthetic.py`.

The sets are invented: round elements, exported by the sgp4 package, catalogue numbers 99001 on. They look like the orbits
of the craft they are named after and are nobody's.
"""

import hashlib
import math
from pathlib import Path

import tomli_w

from rso_lidar.units import DAY_S, DEG

HERE = Path(__file__).resolve().parent


def element_set(
    name, number, epoch, *, e, i_deg, raan_deg, perigee_deg, anomaly_deg, rev_per_day, bstar=0.0, designator="24001A"
):
    """Return the three lines of an invented element set; `epoch` is (year, month, day, hour, minute, second) UTC."""
    from sgp4.api import WGS72, Satrec, jday
    from sgp4.exporter import export_tle

    jd, fraction = jday(*epoch)
    satellite = Satrec()
    satellite.sgp4init(
        WGS72, "i", number, jd + fraction - 2433281.5, bstar, 0.0, 0.0, e,
        perigee_deg * DEG, i_deg * DEG, anomaly_deg * DEG,
        rev_per_day * math.tau / (DAY_S / 60.0), raan_deg * DEG,
    )  # fmt: skip
    satellite.classification, satellite.intldesg, satellite.elnum, satellite.revnum = "U", designator, 1, 1
    satellite.ephtype = 0
    return "\n".join([name, *export_tle(satellite)]) + "\n"


# fmt: off
SETS = {
    "tdrs": (
        "A geosynchronous relay satellite of moderate inclination",
        [
            element_set(
                "TDRS (SYNTHETIC)", 99001, (2024, 9, 17, 6, 0, 0),
                e=2.5e-4, i_deg=4.3, raan_deg=71.0, perigee_deg=120.0, anomaly_deg=215.0, rev_per_day=1.00273791,
            )
        ],
    ),
    # At the epoch both cross the equator northward, the follower 0.0124 deg (1.5 km) behind. Their planes, 0.19 deg apart
    # in inclination, cross there too, so that the two pass at 7.6 km/s x 0.19 deg = 25 m/s.
    "flyby": (
        "Two objects in low Earth orbit whose planes cross at the node: they pass at 1.5 km and 25 m/s, 17 September 2024",
        [
            element_set(
                "ROCKET BODY (SYNTHETIC)", 99002, (2024, 9, 17, 12, 0, 0), designator="24002B",
                e=1.0e-3, i_deg=97.60, raan_deg=35.0, perigee_deg=90.0, anomaly_deg=270.0, rev_per_day=15.06,
            ),
            element_set(
                "FOLLOWER (SYNTHETIC)", 99003, (2024, 9, 17, 12, 0, 0), designator="24002C",
                e=1.0e-3, i_deg=97.79, raan_deg=35.0, perigee_deg=90.0, anomaly_deg=269.9876, rev_per_day=15.06,
            ),
        ],
    ),
}
# fmt: on


def main():
    """Write each set to its file, and the index with sizes and sums."""
    entries = []
    for stem, (what, sets) in SETS.items():
        path = HERE / f"{stem}.tle"
        path.write_text("".join(sets), encoding="ascii")
        blob = path.read_bytes()
        entries.append(
            {
                "name": stem,
                "file": path.name,
                "what": what,
                "source": "synthetic: tle/make_synthetic.py, with the exporter of the sgp4 package",
                "licence": "MIT",
                "size_bytes": len(blob),
                "sha256": hashlib.sha256(blob).hexdigest(),
            }
        )
    (HERE / "index.toml").write_text(tomli_w.dumps({"element_sets": entries}), encoding="utf-8")


if __name__ == "__main__":
    main()
