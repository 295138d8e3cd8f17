"""Publication of datasets: the card, the Croissant description and the table of frames in their folder."""
