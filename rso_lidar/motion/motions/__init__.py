"""Motions that are prescribed or integrated, and the protocol of all motions."""
