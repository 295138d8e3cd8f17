"""Conjunction screening: every close approach of many objects to one follower."""
