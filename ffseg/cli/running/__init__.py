"""What a command does while it works: take signals, tell how far it is, show how it ended."""
