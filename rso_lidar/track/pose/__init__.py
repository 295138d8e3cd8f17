"""Pose of a target and angles of its hinges: points of one cloud against its mesh, and from cloud to cloud."""
