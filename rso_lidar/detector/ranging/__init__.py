"""From stored samples to ranges and intensities."""
