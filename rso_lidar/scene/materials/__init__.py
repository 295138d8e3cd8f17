"""How surfaces scatter light: BRDFs without the cosine."""
