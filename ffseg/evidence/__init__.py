"""Evidence beyond the gradient: pixel features, learned forests, and maps of what lies inside."""
