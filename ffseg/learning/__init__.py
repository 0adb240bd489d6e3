"""Learning a model from masks, tuning parameters."""
