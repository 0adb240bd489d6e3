"""Images the project draws itself, with their truths: the same bytes on every machine.

Drawing uses only operations that IEEE 754 rounds the same way everywhere (no sine, no random library), and the PNG
writer does its own compression, because the output of zlib differs between its builds.
"""
