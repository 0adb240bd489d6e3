"""Drawn places and things with truth, from which the prior learns beside photographs: rooms, streets, things, mirrors.

No photograph is needed for them, and nothing in them is taken from one: surfaces are ray cast or painted, with light,
shadow, gloss, paint, tiles and camera noise drawn at random far beyond what is likely, so that a forest learns what
holds in all of them. ``python -m tests.campaigns.places.drawn --sheet FILE`` shows some.
"""
