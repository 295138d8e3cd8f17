"""Forms of the studio: fields, choices, units and bounds read from the parts, without a list of their own."""
