"""Starts of the contour: as given, moved off edges, in further components, and against background fronts."""
