"""Datasets made: samples flown and labelled, shards written by processes, folders resumed and checked."""
