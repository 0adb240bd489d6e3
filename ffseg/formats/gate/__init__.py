"""What the header of an image file says before a decoder sees it."""
