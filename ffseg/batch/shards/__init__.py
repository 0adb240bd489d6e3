"""A run in parts on many machines, and the parts put together."""
