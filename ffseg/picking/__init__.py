"""Pick regions in a browser: clicks become masks, starts and a model while they are made."""
