"""A plot of any number on the socket, on the page: a card alone, which the daemon does nothing for."""
