"""Models of spacecraft: cards of their geometry and materials, and the list of materials."""
