"""Motion between two images: candidate ground points, the fit on them, and possible errors of the poses."""
