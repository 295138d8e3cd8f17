"""Style of all pictures: colours, the page of a figure, and figures written as files."""
