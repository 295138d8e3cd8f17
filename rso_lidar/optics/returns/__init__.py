"""Light back: photons of each hit, spread by the lens and grouped by depth."""
