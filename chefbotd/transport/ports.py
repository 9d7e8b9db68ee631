"""Ports for programs that somebody starts and then connects to, such as the daemon of a test or a demonstration."""

import atexit
import socket


def reserve_port() -> int:
    """A TCP port of the loopback interface that the system gives to nobody else until this process ends.

    Who asks for it by its number can listen there, any number of times in turn; until then nobody listens. A port that
    is chosen and let go instead may be given to another program before the one that it was for listens: its clients
    then talk to a stranger.

    The socket that keeps it is bound, does not listen and has SO_REUSEADDR: Linux lets another one with that option
    bind the same port by its number, and gives it to nobody who asks for any port (socket(7), ip(7)).
    """
    kept = socket.socket()
    kept.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    kept.bind(("127.0.0.1", 0))
    atexit.register(kept.close)
    port: int = kept.getsockname()[1]
    return port
