"""How fast the walk is, side by side with what it stands on."""
