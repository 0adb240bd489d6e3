"""Methods: each a function from a view of the image to what it found."""
