"""What a recording holds: datasets, attributes and checksums, whatever kind of file stores them."""
