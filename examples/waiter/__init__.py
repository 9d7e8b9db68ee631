"""A waiter: an application on the command socket, and a simulated restaurant to try it in."""
