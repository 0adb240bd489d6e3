"""Which files a run writes of each image, and how: one row for each kind of output."""
