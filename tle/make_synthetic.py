"""Write the synthetic files of this folder, and the index of all that lies here: `python tle/make_synthetic.py`.

The element sets are invented: round elements, exported by the sgp4 package, catalogue numbers 99001 on. They look like the
orbits of the craft they are named after and are nobody's. So are the states and covariances of the conjunction message.
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
    "envisat": (
        "A large dead satellite in a sun-synchronous orbit, 765 km up, with the orbit of Envisat but for its node",
        [
            element_set(
                "ENVISAT (SYNTHETIC)", 99004, (2024, 9, 17, 10, 0, 0), designator="24003A",
                e=2.0e-4, i_deg=98.2, raan_deg=230.0, perigee_deg=90.0, anomaly_deg=270.0, rev_per_day=14.38,
                bstar=3.0e-5,
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

RADIUS_KM, SPEED_KM_S = 7078.137, 7.504_359_0  # a circular orbit 700 km up
CROSSING_DEG = 0.19  # between the planes, so that the two pass at 25 m/s
SIGMAS_RTN = {  # standard deviations of radial, along-track and cross-track position [m] and velocity [m/s]
    "FOLLOWER (SYNTHETIC)": (10.0, 60.0, 8.0, 0.060, 0.010, 0.008),
    "ROCKET BODY (SYNTHETIC)": (20.0, 150.0, 15.0, 0.150, 0.020, 0.015),
}


def conjunction_message():
    """Return a conjunction data message (CDM): both objects on the x axis of GCRF, 120 m apart, radial and along-track."""
    c, s = (SPEED_KM_S * f(97.6 * DEG) for f in (math.cos, math.sin))
    c2, s2 = (SPEED_KM_S * f((97.6 + CROSSING_DEG) * DEG) for f in (math.cos, math.sin))
    x, y, z = 0.040, 0.113_137 * c / SPEED_KM_S, 0.113_137 * s / SPEED_KM_S
    states = ((RADIUS_KM, 0.0, 0.0, 0.0, c, s), (RADIUS_KM + x, y, z, 0.0, c2, s2))
    lines = [
        "CCSDS_CDM_VERS = 1.0",
        "COMMENT Invented by tle/make_synthetic.py: nobody's objects",
        "CREATION_DATE = 2024-09-16T12:00:00",
        "ORIGINATOR = RSO_LIDAR",
        "MESSAGE_ID = SYNTHETIC-1",
        "TCA = 2024-09-17T12:00:00.000",
        "MISS_DISTANCE = 120 [m]",
        "RELATIVE_SPEED = 25 [m/s]",
        "COMMENT HBR = 6 [m]",
    ]
    axes = ("R", "T", "N", "RDOT", "TDOT", "NDOT")
    for k, ((name, sigmas), state) in enumerate(zip(SIGMAS_RTN.items(), states, strict=True), start=1):
        lines += [
            f"OBJECT = OBJECT{k}",
            f"OBJECT_DESIGNATOR = {99004 - k}",
            "CATALOG_NAME = SATCAT",
            f"OBJECT_NAME = {name}",
            f"INTERNATIONAL_DESIGNATOR = 2024-002{'BC'[2 - k]}",
            "EPHEMERIS_NAME = NONE",
            "COVARIANCE_METHOD = DEFAULT",
            "MANEUVERABLE = N/A",
            "REF_FRAME = GCRF",
        ]
        units = ("[km]",) * 3 + ("[km/s]",) * 3
        names = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
        lines += [f"{key} = {value:.9f} {unit}" for key, value, unit in zip(names, state, units, strict=True)]
        for row in range(6):
            for column in range(row + 1):
                # an error along the track comes from the period, and so from the radial one's rate
                share = 1.0 if row == column else -0.9 if (row, column) == (3, 1) else 0.0
                value = share * sigmas[row] * sigmas[column]
                unit = "[m**2]" if row < 3 else "[m**2/s]" if column < 3 else "[m**2/s**2]"
                lines.append(f"C{axes[row]}_{axes[column]} = {value:.6e} {unit}")
    return "\n".join(lines) + "\n"


# what is in the message, and its text, by name
MESSAGES = {
    "flyby": (
        "A conjunction of two objects in low Earth orbit: 120 m and 25 m/s, 17 September 2024",
        conjunction_message(),
    )
}


def write(path, text, what, source):
    """Write a file, and return its entry of the index."""
    path.write_text(text, encoding="ascii")
    blob = path.read_bytes()
    return {
        "name": path.stem,
        "file": path.name,
        "what": what,
        "source": source,
        "licence": "MIT",
        "size_bytes": len(blob),
        "sha256": hashlib.sha256(blob).hexdigest(),
    }


def main():
    """Write each set and message to its file, and the index with sizes and sums."""
    made_by = "synthetic: tle/make_synthetic.py"
    sets = [
        write(HERE / f"{stem}.tle", "".join(texts), what, f"{made_by}, with the exporter of the sgp4 package")
        for stem, (what, texts) in SETS.items()
    ]
    messages = [write(HERE / f"{stem}.cdm", text, what, made_by) for stem, (what, text) in MESSAGES.items()]
    index = tomli_w.dumps({"element_sets": sets, "conjunction_messages": messages})
    (HERE / "index.toml").write_text(index, encoding="utf-8")


if __name__ == "__main__":
    main()
