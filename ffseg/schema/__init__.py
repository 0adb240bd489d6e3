"""Declared values: what a key may hold, where it was written, and what is wrong with it."""
