"""Light out: the rays of one flash, along scan lines that contours of targets cut into intervals."""
