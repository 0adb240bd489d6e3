"""Outputs in tar files."""
