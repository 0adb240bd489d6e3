"""Commands that learn from masks."""
