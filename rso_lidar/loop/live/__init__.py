"""Live views: frames shown to viewers while they are made."""
