"""Models of relative motion in a chief's rtn axes, and those axes."""
