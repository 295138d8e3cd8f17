"""Element sets (TLE and OMM): their formats, catalogues, and propagation by SGP4."""
