"""What light does to an image, undone as far as it can be before edges are looked for."""
