"""Processes that work on images: what they are told, what they do, and who watches them."""
