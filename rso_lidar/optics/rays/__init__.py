"""Light out: the rays of one flash, through the cells of the focal plane that targets cover."""
