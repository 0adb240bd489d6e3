"""Rendered scenes: catadioptric views of a ground plane with marks, boxes and walls, with their truths. Numpy only."""
