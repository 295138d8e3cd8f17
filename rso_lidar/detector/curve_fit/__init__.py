"""Constants of a detector fitted to curves that a laboratory measured."""
