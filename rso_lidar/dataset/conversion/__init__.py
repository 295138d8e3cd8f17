"""Datasets in formats of other libraries: tar archives, image folders with COCO annotations, and TFRecord files."""
