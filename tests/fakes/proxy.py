"""A small reverse proxy: ends TLS, shows a server under a folder of its own, and passes WebSockets on."""

import asyncio
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import trustme


@contextmanager
def tls_proxy(folder: str, upstream_port: int, port: int) -> Iterator[None]:
    """``https://127.0.0.1:PORT/FOLDER/x`` is ``http://127.0.0.1:UPSTREAM/x`` for as long as the block lasts."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    trustme.CA().issue_cert("127.0.0.1").configure_cert(context)

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while data := await reader.read(65_536):
                writer.write(data)
                await writer.drain()
        except ConnectionError:
            pass  # a browser leaves as it likes
        finally:
            writer.close()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            first, *lines = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        except (asyncio.IncompleteReadError, ConnectionError):
            return writer.close()
        method, path, version = first.split()
        if not path.startswith(f"/{folder}/"):
            writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
            return writer.close()
        is_socket = any(line.lower() == "upgrade: websocket" for line in lines)
        replaced = ("host:",) if is_socket else ("host:", "connection:")
        headers = [line for line in lines if line and not line.lower().startswith(replaced)]
        headers += [f"Host: 127.0.0.1:{upstream_port}", *(() if is_socket else ("Connection: close",))]
        below, above = await asyncio.open_connection("127.0.0.1", upstream_port)
        path = path.removeprefix(f"/{folder}")
        above.write("\r\n".join([f"{method} {path} {version}", *headers, "", ""]).encode())
        await asyncio.gather(pass_on(below, writer), pass_on(reader, above))
        return None

    async def run() -> None:
        server = await asyncio.start_server(serve, "127.0.0.1", port, ssl=context)
        began.set()
        async with server:
            await asyncio.to_thread(ends.wait)

    began, ends = threading.Event(), threading.Event()
    thread = threading.Thread(target=lambda: asyncio.run(run()))
    thread.start()
    assert began.wait(60.0)
    try:
        yield
    finally:
        ends.set()
        thread.join()
