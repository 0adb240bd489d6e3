"""ffseg bench: ratios measured in one run, and the gate on them."""
