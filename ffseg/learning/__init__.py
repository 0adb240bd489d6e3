"""Learning: the forests that come with ffseg (`grow`), models from a few masks (`learn`), and settings (`tune`)."""
