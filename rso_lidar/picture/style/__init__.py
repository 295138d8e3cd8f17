"""What all pictures share: colours, the page of a figure, and figures written as files."""
