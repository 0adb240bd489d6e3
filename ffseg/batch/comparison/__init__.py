"""What a comparison finds, as values and as text."""
