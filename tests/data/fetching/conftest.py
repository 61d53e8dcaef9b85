"""A publisher for every test of downloads."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.data.fetching.publisher import Publisher, serving


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    """A server on this machine with nothing published yet."""
    with serving() as found:
        yield found
