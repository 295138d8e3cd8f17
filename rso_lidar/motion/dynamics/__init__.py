"""A user's own equations of motion x' = f(t, x, u): found, checked and integrated."""
