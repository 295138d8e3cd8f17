"""Sequences of proximity operations: legs, the conditions that end them, and the transfers that join them."""
