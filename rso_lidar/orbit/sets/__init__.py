"""Element sets (TLE and OMM): their texts, catalogues, and SGP4."""
