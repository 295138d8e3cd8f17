"""Targeting: values of a plan that reach goals within limits under the flown forces, at the least cost."""
