"""The photon's life in a pixel, stage by stage; each takes its own part."""
