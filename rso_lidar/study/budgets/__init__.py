"""How far a camera detects, and how precisely it ranges: link budgets in closed form."""
