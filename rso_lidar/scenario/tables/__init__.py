"""The tables of a scenario file, each a part that its TOML table fills."""
