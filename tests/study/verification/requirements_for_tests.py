"""Requirements of a plate on a bench, for tests."""

FILE = """
version = 1
name    = "A plate"

[[requirement]]
id         = "A-1"
text       = "All pixels shall report."
quantity   = "detection_fraction"
at_least   = 0.5
confidence = 0.9

[[requirement]]
id       = "A-2"
text     = "A pixel shall be small."
quantity = "lidar.receiver.ifov_rad"
at_most  = 1e-6
source   = "nobody"
verification = "inspection"
"""
