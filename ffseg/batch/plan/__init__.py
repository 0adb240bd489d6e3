"""Which images are done with what: discovering, reading lists, one job for each image."""
