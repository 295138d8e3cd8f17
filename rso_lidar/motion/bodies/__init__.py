"""Bodies: a name, a motion, an attitude, hinges and extra axes, and the order in which they are computed."""
