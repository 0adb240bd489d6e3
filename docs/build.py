"""Build the site: ``pip install -e '.[docs]' && python docs/build.py [FOLDER]``; a warning or a dead link is an error.

Links to pages and headings are checked by the build, addresses outside only with ``--links``, which asks the network.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from sphinx.cmd.build import main as sphinx

HERE = Path(__file__).resolve().parent


def main() -> int:
    """Build the pages; the first one is ``index.html``."""
    parser = argparse.ArgumentParser(description="Build the site; a warning or a dead link is an error.")
    parser.add_argument("folder", nargs="?", type=Path, default=HERE.parent / "build" / "site", help="where to")
    parser.add_argument("--links", action="store_true", help="ask the network for addresses outside, too")
    options = parser.parse_args()
    target, builders = options.folder, ["html", "linkcheck"] if options.links else ["html"]
    for builder in builders:
        code = sphinx(["-W", "--keep-going", "-q", "-j", "auto", "-b", builder, str(HERE), str(target)])
        if code:
            return code
    shutil.copyfile(target / "README.html", target / "index.html")
    print(target / "index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
