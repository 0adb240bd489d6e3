"""Who works on images: each takes tasks and gives replies, and does nothing else."""
