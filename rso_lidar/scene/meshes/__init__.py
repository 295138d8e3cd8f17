"""Read mesh files: triangles in metres, by named parts."""
