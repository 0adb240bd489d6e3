"""What must hold of an image file before it is decoded, and what a decoder would silently get wrong."""
