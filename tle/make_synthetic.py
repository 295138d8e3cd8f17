"""Write the synthetic element sets of this folder, and the index of all that lies here: `python tle/make_synthetic.py`.

The sets are invented: round elements, exported by the sgp4 package, catalogue numbers 99001 on. They look like the orbits
of the craft they are named after and are nobody's.
"""

import hashlib
import math
from pathlib import Path

import tomli_w
from sgp4.api import WGS72, Satrec, jday
from sgp4.exporter import export_tle

HERE = Path(__file__).resolve().parent


def element_set(name, number, epoch, *, e, i_deg, raan_deg, perigee_deg, anomaly_deg, rev_per_day, bstar=0.0):
    """Return the three lines of an invented element set; `epoch` is (year, month, day, hour, minute, second) UTC."""
    jd, fraction = jday(*epoch)
    satellite = Satrec()
    satellite.sgp4init(
        WGS72, "i", number, jd + fraction - 2433281.5, bstar, 0.0, 0.0, e,
        math.radians(perigee_deg), math.radians(i_deg), math.radians(anomaly_deg),
        rev_per_day * 2.0 * math.pi / 1440.0, math.radians(raan_deg),
    )  # fmt: skip
    satellite.classification, satellite.intldesg, satellite.elnum, satellite.revnum = "U", "24001A", 1, 1
    satellite.ephtype = 0
    return "\n".join([name, *export_tle(satellite)]) + "\n"


SETS = {
    "tdrs": (
        "A geosynchronous relay satellite of moderate inclination",
        [
            element_set(
                "TDRS (SYNTHETIC)", 99001, (2024, 9, 17, 6, 0, 0),
                e=2.5e-4, i_deg=4.3, raan_deg=71.0, perigee_deg=120.0, anomaly_deg=215.0, rev_per_day=1.00273791,
            )  # fmt: skip
        ],
    ),
}


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
