"""A pytest plugin that puts another native module, or another copy of the package, in the place of the installed one.

``FFSEG_OTHER_CORE`` names a module, ``FFSEG_OTHER_TREE`` a folder with a package ``ffseg`` without one.
"""

import importlib.machinery
import importlib.util
import os
import sys
from types import ModuleType

NAME = "ffseg.native._core"


def loaded(path: str) -> ModuleType:
    """The module at a path."""
    loader = importlib.machinery.ExtensionFileLoader(NAME, path)
    spec = importlib.util.spec_from_file_location(NAME, path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def put_in_place(path: str) -> None:
    """Load the module at a path under the name of the installed one, before anything imports that."""
    assert NAME not in sys.modules, "the installed core is loaded already"
    sys.modules[NAME] = module = loaded(path)
    import ffseg.native

    ffseg.native._core = module


def take_tree(folder: str) -> None:
    """Import the package from a folder, with the installed native module, which cannot be loaded twice."""
    from ffseg.native import _core

    for name in [name for name in sys.modules if name.partition(".")[0] == "ffseg"]:
        del sys.modules[name]
    sys.meta_path[:] = [finder for finder in sys.meta_path if "ScikitBuild" not in type(finder).__name__]
    sys.path.insert(0, folder)
    import ffseg.native

    assert str(ffseg.__file__).startswith(folder)
    sys.modules[NAME] = ffseg.native._core = _core


if "FFSEG_OTHER_TREE" in os.environ:
    take_tree(os.environ["FFSEG_OTHER_TREE"])
elif "FFSEG_OTHER_CORE" in os.environ:
    put_in_place(os.environ["FFSEG_OTHER_CORE"])
