"""A camera calibrated: tables that a laboratory measured, the constants fitted to them, a preset file and a report."""
