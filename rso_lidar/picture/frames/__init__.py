"""Images of frames: one frame as a figure, many on one page, or all as an animation."""
