"""Settings of the detectors: parts that a user describes, with derived quantities."""
