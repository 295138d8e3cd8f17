"""What a real lens does to the image: distortion and point spread functions."""
