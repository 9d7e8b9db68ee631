"""The command socket: a JSON object a line over TCP, with TLS where it is configured."""
