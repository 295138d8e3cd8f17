"""Questions asked of the shipped detectors: loads of the array, closed forms, words."""
