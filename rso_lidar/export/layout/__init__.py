"""Layout of a recording: datasets, attributes and checksums, the same in every kind of file."""
