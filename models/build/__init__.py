"""Builders of the shipped models; `python -m models.build.write` writes models/. No part of the package needs them."""
