"""What all tests share: options, golden files, the data folder, the command line."""

import contextlib
import faulthandler
import io
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import chromium
import numpy as np
import pytest
import rendered
from commands import Command
from hypothesis import settings

from ffseg.cli.app import main
from ffseg.samples.png import encode
from ffseg.samples.scenes import SCENES
from tests import real_data

ROOT = Path(__file__).resolve().parent.parent

# Reproducible examples; no deadline, because a loaded machine is no defect of the code.
settings.register_profile("short", deadline=None, max_examples=50, derandomize=True)
settings.register_profile("long", deadline=None, max_examples=2000, print_blob=True)


HUNG = 900.0
"""Seconds after which a test hangs: its process says where and ends, and pytest-xdist begins another. One that compiles takes
90 on two cores that have nothing else to do."""
_STDERR = pytest.StashKey[int]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write golden files and generated pages anew")
    parser.addoption("--long", action="store_true", help="run the long form of the campaigns")


def pytest_configure(config: pytest.Config) -> None:
    # Under nohup, and behind "&" in a script, the commands that are tested would ignore these as well.
    for name, usual in (("SIGHUP", signal.SIG_DFL), ("SIGINT", signal.default_int_handler)):
        number = getattr(signal, name, None)  # not every system has all
        if number is not None and signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, usual)
    config.stash[_STDERR] = os.dup(2)  # tests find it captured
    settings.load_profile("long" if config.getoption("--long") else "short")
    if not hasattr(config, "workerinput"):  # the process that starts the others
        os.environ[rendered.FOLDER] = folder = tempfile.mkdtemp(prefix="ffseg-rendered-")
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--long"):
        return
    for item in items:
        if "long" in item.keywords:
            item.add_marker(pytest.mark.skip(reason="long form of a campaign; run with --long"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    if not item.config.getoption("--long"):
        faulthandler.dump_traceback_later(HUNG, exit=True, file=item.config.stash[_STDERR])
    result = yield
    faulthandler.cancel_dump_traceback_later()
    return result


@pytest.fixture(autouse=True, scope="session")
def _samples_are_drawn_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ffseg.samples.write.render_pair", rendered.render_pair)
        for name, draw in list(SCENES.items()):
            patch.setitem(SCENES, name, rendered.once(draw))
        patch.setattr("ffseg.samples.write.encode", lambda image: _encoded(image.shape, image.tobytes()))
        yield


@cache
def _encoded(shape: tuple[int, ...], data: bytes) -> bytes:
    return encode(np.frombuffer(data, np.uint8).reshape(shape))


@pytest.fixture
def update_golden(request: pytest.FixtureRequest) -> bool:
    """True when golden files are to be rewritten instead of compared."""
    return bool(request.config.getoption("--update-golden"))


@pytest.fixture
def golden(update_golden: bool) -> Callable[[Path, str], None]:
    """Compare whole text with a file kept in the repository; --update-golden writes it."""

    def compare(path: Path, text: str) -> None:
        if update_golden:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", newline="\n")
        name = path.relative_to(ROOT)
        assert path.is_file(), f"{name} is missing; write it with pytest --update-golden"
        assert path.read_text(encoding="utf-8") == text, f"{name} is stale; write it anew with pytest --update-golden"

    return compare


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """The output folder of a run, which is not there yet."""
    return tmp_path / "out"


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of the real images to develop on; tests that need it skip where it is absent."""
    folder = real_data.data_folder()
    if not folder.is_dir():
        pytest.skip(f"no data folder {folder}; name it in the environment variable FFSEG_DATA")
    return folder


@pytest.fixture(scope="session")
def program_at_work(tmp_path_factory: pytest.TempPathFactory) -> Iterator[chromium.Chromium]:
    program = chromium.find()
    if program is None:
        pytest.skip("no Chromium on the search path; install it, or name one in FFSEG_CHROMIUM")
    with chromium.Chromium(program, tmp_path_factory.mktemp("profile")) as running:
        yield running


@pytest.fixture
def browser(program_at_work: chromium.Chromium) -> chromium.Chromium:
    """The browser with a new tab: nothing that an earlier test has left, or that its page still says, is in it."""
    program_at_work.renew()
    return program_at_work


@pytest.fixture(scope="session")
def ffseg_process() -> Command:
    """Run ``ffseg`` as its own process; returns exit code, stdout and stderr."""

    def run(*arguments: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "ffseg", *map(str, arguments)]
        return subprocess.run(
            command, check=False, capture_output=True, text=True, encoding="utf-8", timeout=600, **options
        )

    return run


@pytest.fixture(scope="session")
def ffseg_command() -> Command:
    """The same in this process, and so the images of ``run``, unless it is told how: where no process is what is tested.

    With a `code` it must end with that."""

    def run(
        *arguments: str | Path,
        cwd: Path | None = None,
        input: str = "",  # noqa: A002
        code: int | None = None,
    ) -> subprocess.CompletedProcess[str]:
        words = [*map(str, arguments)]
        if words[:1] == ["run"] and not {"--jobs", "--executor", "--help", "-"} & set(words):
            words += ["--executor", "inprocess"]
        streams = [io.TextIOWrapper(io.BytesIO(data), "utf-8") for data in (input.encode(), b"", b"")]
        with pytest.MonkeyPatch.context() as patch, contextlib.chdir(cwd or os.getcwd()):
            patch.setattr(sys, "argv", ["ffseg", *words])
            for name, stream in zip(("stdin", "stdout", "stderr"), streams, strict=True):
                patch.setattr(sys, name, stream)
            with pytest.raises(SystemExit) as ended:
                main()
        said = [bytes(stream.detach().getbuffer()).decode() for stream in streams[1:] if stream.flush() is None]
        done = subprocess.CompletedProcess(words, int(ended.value.code or 0), *said)
        assert code in (None, done.returncode), done.stderr + done.stdout
        return done

    return run
