"""What a result can be saved as."""
