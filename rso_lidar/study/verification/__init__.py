"""Verification of requirements: values of a scenario, a study or a recording against bounds, with a confidence."""
