"""A pytest plugin that puts the native module named by ``FFSEG_OTHER_CORE`` in the place of the installed one."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import sys

NAME = "ffseg.native._core"


def put_in_place(path: str) -> None:
    """Load the module at a path under the name of the installed one, before anything imports that."""
    assert NAME not in sys.modules, "the installed core is loaded already"
    loader = importlib.machinery.ExtensionFileLoader(NAME, path)
    spec = importlib.util.spec_from_file_location(NAME, path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    sys.modules[NAME] = module
    import ffseg.native

    ffseg.native._core = module


if "FFSEG_OTHER_CORE" in os.environ:
    put_in_place(os.environ["FFSEG_OTHER_CORE"])
