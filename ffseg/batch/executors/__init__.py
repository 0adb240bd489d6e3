"""Executors: they take tasks and return replies, and do nothing else."""
