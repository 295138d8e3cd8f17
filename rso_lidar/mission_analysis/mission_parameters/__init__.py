"""Parameters of a mission: values, units, meanings and sources of all keys and derived figures, as CSV and SysML v2."""
