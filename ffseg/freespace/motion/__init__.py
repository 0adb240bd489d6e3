"""The motion between two images: the points that show the ground, the fit on them, and what may be wrong with poses."""
