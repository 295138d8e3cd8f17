"""Documents of the studio: the text of a scenario while it is edited, with its file, and its assessment."""
