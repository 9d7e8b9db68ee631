"""The page's files, read once at the start, so that no request reads the disk."""

from importlib import resources

from msgspec import Struct

TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}


class PageFile(Struct, frozen=True):
    """A file as it is sent."""

    content_type: str
    body: bytes


def page_files() -> dict[str, PageFile]:
    """Every file of the page by its path; ``/`` is ``index.html``."""
    folder = resources.files(__package__) / "page"
    files = {
        f"/{entry.name}": PageFile(TYPES[suffix], entry.read_bytes())
        for entry in folder.iterdir()
        if (suffix := entry.name.rpartition(".")[2]) in TYPES
    }
    return {"/": files["/index.html"], **files}
