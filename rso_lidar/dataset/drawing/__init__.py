"""From the number of a sample to the scenario that it flies."""
