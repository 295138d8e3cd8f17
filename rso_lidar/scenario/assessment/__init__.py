"""What a mission holds, in words: its description, warnings and broken constraints."""
