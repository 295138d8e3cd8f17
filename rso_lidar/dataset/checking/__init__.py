"""Checks of datasets: balance and leaks of a specification before it is made, and a folder against its hashes."""
