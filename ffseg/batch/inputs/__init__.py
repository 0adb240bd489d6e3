"""What a run is given beside the images it finds in folders."""
