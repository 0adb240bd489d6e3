"""Options and settings shared by every test; its place puts ``tests/`` (naive, strategies) on the import path."""

from __future__ import annotations

import pytest
from hypothesis import settings

settings.register_profile("short", deadline=None, max_examples=50)
settings.load_profile("short")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="rewrite the golden files from today's output")


@pytest.fixture
def update_golden(request: pytest.FixtureRequest) -> bool:
    """True when golden files are to be rewritten instead of compared."""
    return bool(request.config.getoption("--update-golden"))
