"""What a run remembers of an output folder, and the tables written from it."""
