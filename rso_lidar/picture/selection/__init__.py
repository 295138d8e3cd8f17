"""Selection from a sequence: the frames, the part of the field and the limits that are drawn."""
