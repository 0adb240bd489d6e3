"""Declared values: their kinds, their origins, and problems with them."""
