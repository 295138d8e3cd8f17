"""Frames for training: fixed transforms, augmentation by the physics of the sensor, and the order of visits."""
