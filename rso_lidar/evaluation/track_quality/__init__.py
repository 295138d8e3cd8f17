"""Errors of trackers on the target of a recording, and their consistency."""
