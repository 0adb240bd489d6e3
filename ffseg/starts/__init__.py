"""Where a contour starts: as asked, moved off edges, in further parts, against rivals."""
