"""What goes over the command socket, as pydantic models: parameters, results and topic data.

The server and the client library both import them from here, so that neither has to know the other.
"""
