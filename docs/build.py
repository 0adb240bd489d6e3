"""Build the site: ``pip install -e '.[docs]' && python docs/build.py [FOLDER]``; a warning or a dead link is an error.

Links to pages and headings are checked by the build, addresses outside only with ``--links``, which asks the network.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from sphinx.cmd.build import main as sphinx

HERE = Path(__file__).resolve().parent


def main(arguments: list[str]) -> int:
    """Build the pages; the first one is ``index.html``."""
    folders = [one for one in arguments if one != "--links"]
    target = Path(folders[0]) if folders else HERE.parent / "build" / "site"
    builders = ["html", "linkcheck"] if "--links" in arguments else ["html"]
    for builder in builders:
        code = sphinx(["-W", "--keep-going", "-q", "-j", "auto", "-b", builder, str(HERE), str(target)])
        if code:
            return code
    shutil.copyfile(target / "README.html", target / "index.html")
    print(target / "index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
