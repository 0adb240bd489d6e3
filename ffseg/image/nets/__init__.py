"""What OpenCV adds to maps of evidence: networks, and the parts of the region that a map walls in."""
