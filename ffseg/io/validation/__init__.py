"""Checks of image files before they are decoded, for what decoders would silently get wrong."""
