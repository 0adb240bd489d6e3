"""Write the sample images and their truths into a folder."""

from __future__ import annotations

from pathlib import Path

from ffseg.errors import OutputError
from ffseg.samples.png import encode
from ffseg.samples.scenes import SCENES


def sample_files() -> dict[str, bytes]:
    """Contents of every sample file by its path, ``NAME.png`` and ``truth/NAME.png``."""
    files = {}
    for name, draw in SCENES.items():
        scene = draw()
        files[f"{name}.png"] = encode(scene.image)
        files[f"truth/{name}.png"] = encode(scene.truth)
    return files


def write_samples(folder: Path) -> list[Path]:
    """Write every sample file under `folder`; files of these names are replaced.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    written = []
    for name, content in sample_files().items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        except OSError as error:
            raise OutputError(f"{path} cannot be written ({error.strerror}); choose another folder") from error
        written.append(path)
    return written
