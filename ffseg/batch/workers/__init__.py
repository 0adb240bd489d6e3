"""Worker processes: their messages, their work and their supervision."""
