"""Labels of a frame for learning: common part classes, boxes, lit and reporting pixels, visibility."""
