"""Recordings shown, converted to other formats, and traced back to their scenario."""
