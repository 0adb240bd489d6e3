"""``python -m ffseg``."""

from ffseg.cli.app import main

main()
