"""The stages put together: what a detector stores and says of one flash."""
