"""Embree 4: acceleration structures and packets of rays, from the library inside embreex's wheel."""
