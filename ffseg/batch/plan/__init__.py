"""The plan of a run: inputs are discovered, lists read, and one job made for each image."""
