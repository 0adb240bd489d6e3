"""Runs divided among machines, and their merge."""
