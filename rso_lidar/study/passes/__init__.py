"""Which objects of a catalogue pass near a follower, and what a lidar could see of them."""
