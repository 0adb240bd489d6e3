"""Drawn pictures with truth, from which the forests that come with ffseg learn: floors, streets, things, planes.

No photograph is needed for them, and nothing in them is taken from one: surfaces are ray cast or painted, with light,
shadow, gloss, paint, tiles and camera noise drawn at random far beyond what is likely, so that a forest learns what
holds in all of them. ``python -m ffseg.learning.drawn.sights --sheet FILE`` shows some.
"""
