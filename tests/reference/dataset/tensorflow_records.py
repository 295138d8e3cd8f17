"""CRC-32C bit by bit, the oracle of `rso_lidar.dataset.conversion.tensorflow_files.compute_crc32c`.

The division of polynomials over GF(2) as RFC 3720 (appendix B.4) states it: bits reversed, all ones before and after.
"""


def compute_crc32c(content):
    """Return the CRC-32C of bytes."""
    remainder = 0xFFFFFFFF
    for byte in bytes(content):
        for bit in range(8):
            odd = (remainder ^ (byte >> bit)) & 1
            remainder = (remainder >> 1) ^ (0x82F63B78 if odd else 0)
    return remainder ^ 0xFFFFFFFF
