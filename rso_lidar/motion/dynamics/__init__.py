"""User-defined equations of motion x' = f(t, x, u), and their integration."""
