"""Calibrated omnidirectional cameras: rays, files and motion. Knows no image."""
