"""One run over time, computed without rendering its frames."""
