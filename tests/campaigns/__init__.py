"""Long forms of tests and measurements, ``python -m tests.campaigns.NAME``; they share the modules of ``tests``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
