"""Published element sets, as lines, and how tests change them."""

import datetime

from rso_lidar.orbit.sets.tle_text import compute_checksum

# Real sets (CelesTrak): Envisat at two epochs, TerraSAR-X.
ENVISAT_2013 = (
    "1 27386U 02009A   13296.16551405  .00000100  00000-0  47533-4 0  8339",
    "2 27386 098.4160 001.9229 0001126 079.5538 280.5787 14.37637337609529",
)
ENVISAT_2020 = (
    "1 27386U 02009A   20290.00854375  .00000022  00000-0  20588-4 0  9993",
    "2 27386  98.1398 290.7332 0001195  90.6832 325.5676 14.37995280975942",
)
TERRASAR = (
    "1 31698U 07026A   26074.52702793  .00001102  00000+0  55648-4 0  9991",
    "2 31698  97.4465  83.5666 0001759  83.5600 276.5835 15.19149353 39001",
)
BOTH = ["ENVISAT", *ENVISAT_2013, "ENVISAT", *ENVISAT_2020, "0 TERRASAR-X", *TERRASAR]


def utc(*parts):
    return datetime.datetime(*parts, tzinfo=datetime.UTC)


def with_checksum(line):
    return line[:68] + str(compute_checksum(line))
