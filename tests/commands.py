"""What the tests of commands are given: exit code, stdout and stderr of one (see `conftest`)."""

from collections.abc import Callable
from subprocess import CompletedProcess

Command = Callable[..., CompletedProcess[str]]
