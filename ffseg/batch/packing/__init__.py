"""Outputs in tar files: appended while a run works, put in order when it is finished."""
