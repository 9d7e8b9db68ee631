"""A command socket in a process of its own that has 64 descriptors; prints its port on stderr, and its log on stdout."""

import asyncio
import resource
import sys

import uvloop

from tests.fakes.api import serving


async def _serve() -> None:
    async with serving() as served:
        sys.stderr.write(f"{served.port}\n")
        sys.stderr.flush()
        await asyncio.Event().wait()


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_NOFILE, (64, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    uvloop.run(_serve())
