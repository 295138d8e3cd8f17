"""Where rays meet surfaces, and what light reaches the points that they meet."""
