"""Proximity operations, and the plans of legs and impulses that they make."""
