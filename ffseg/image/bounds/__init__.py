"""Where a contour may go, found in the image itself."""
