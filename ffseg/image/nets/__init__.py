"""Networks run by OpenCV."""
