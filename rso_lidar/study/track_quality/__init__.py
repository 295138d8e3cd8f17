"""How well a tracker follows the target of a recording."""
