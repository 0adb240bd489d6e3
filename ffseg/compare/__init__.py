"""ffseg compare: methods side by side."""
