"""Proximity operations, and the plans of legs and impulses that fly them."""
