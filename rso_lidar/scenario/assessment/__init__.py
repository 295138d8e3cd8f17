"""Assessment of a mission: its description, warnings and broken constraints."""
