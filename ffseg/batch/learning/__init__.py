"""Learning from a few masks: models (`learn`) and settings (`tune`), with figures on images that were left out."""
