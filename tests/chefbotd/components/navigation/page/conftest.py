"""A browser, and the page that is open before a daemon of the tests."""

from tests.scenarios.page.conftest import browser, daemon, page, served

__all__ = ["browser", "daemon", "page", "served"]
