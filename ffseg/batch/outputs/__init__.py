"""Kinds of output files of an image: one row for each, and how it is encoded."""
