"""The record of an output folder, and the tables written from it."""
