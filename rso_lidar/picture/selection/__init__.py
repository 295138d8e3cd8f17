"""What of a sequence is drawn: which frames, which part of the field, and within which limits."""
