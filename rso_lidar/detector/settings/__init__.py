"""What a user sets: pure parts, with plain derived quantities."""
