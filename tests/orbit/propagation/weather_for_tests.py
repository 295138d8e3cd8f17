"""Space weather of the storm of May 2024, in both formats of CelesTrak (sw19571001.txt, as of August 2026, less its last
column)."""

import datetime

ROWS = """\
2024 05 05 2601 15 17 13 20 17 10 13 30 43 163   6   5   7   6   4   5  15  32  10 0.6 3 185 180.0 0 178.3 159.4 176.9 175.3
2024 05 06 2601 16 53 23 23 23 40 20 20 13 217  56   9   9   9  27   7   7   5  16 0.9 4 205 174.3 0 178.3 159.4 171.2 175.2
2024 05 07 2601 17 13 13 10 13 20 27 13 13 123   5   5   4   5   7  12   5   5   6 0.3 1 192 207.4 0 178.3 160.0 203.6 175.1
2024 05 08 2601 18 10 17 17 17 17 20  7 10 113   4   6   6   6   6   7   3   4   5 0.2 1 171 231.4 0 178.4 160.8 227.1 175.2
2024 05 09 2601 19  7 13  7 13 10 10 23 20 103   3   5   3   5   4   4   9   7   5 0.2 1 181 237.7 0 178.8 161.8 233.2 175.5
2024 05 10 2601 20 27 27 23 20 37 77 87 87 383  12  12   9   7  22 179 300 300 105 1.9 8 172 227.9 0 179.6 162.8 223.4 176.2
2024 05 11 2601 21 90 83 83 90 87 83 77 77 670 400 236 236 400 300 236 179 179 271 2.3 9 173 218.0 0 180.5 163.6 213.7 177.1
2024 05 12 2601 22 63 70 37 43 20 30 40 63 367  94 132  22  32   7  15  27  94  53 1.6 7 199 226.4 0 181.6 164.4 221.8 178.0
2024 05 13 2601 23 53 60 33 27 33 27 23 23 280  56  80  18  12  18  12   9   9  27 1.2 6 244 220.0 0 182.7 165.0 215.4 179.1
"""
TEXT = f"""DATATYPE CssiSpaceWeather
VERSION 1.2
BEGIN OBSERVED
{ROWS}END OBSERVED
BEGIN MONTHLY_PREDICTED
2026 11 01 2635  7                                                                        83 119.3   116.8 114.3 121.1 118.4
END MONTHLY_PREDICTED
"""
NAMES = (
    "DATE,BSRN,ND,KP1,KP2,KP3,KP4,KP5,KP6,KP7,KP8,KP_SUM,AP1,AP2,AP3,AP4,AP5,AP6,AP7,AP8,AP_AVG,CP,C9,ISN,F10.7_OBS,"
    "F10.7_ADJ,F10.7_DATA_TYPE,F10.7_OBS_CENTER81,F10.7_OBS_LAST81,F10.7_ADJ_CENTER81,F10.7_ADJ_LAST81"
)


def make_csv():
    """Return the same days as SW-All.csv has them, and a month's prediction."""
    lines = [NAMES]
    for row in ROWS.splitlines():
        words = row.split()
        cells = [datetime.date(*map(int, words[:3])).isoformat(), *words[3:24]]
        adjusted, _, adjusted_mean, adjusted_last, flux, mean = words[26:32]
        cells += [*words[24:26], flux, adjusted, "OBS", mean, "0", adjusted_mean, adjusted_last]
        lines.append(",".join(cells))
    return "\n".join([*lines, "2026-11-01,2635,7" + "," * 21 + "83,119.3,116.8,PRM,120,119,118,117", ""])
