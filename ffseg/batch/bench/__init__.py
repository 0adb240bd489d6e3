"""Benchmarks: suites of timed tasks, each beside a fixed kernel K, and the gate that compares two runs."""
