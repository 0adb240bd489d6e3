"""A result as files, documents and a picture."""
