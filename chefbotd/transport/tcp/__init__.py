"""The command socket: one JSON object per line over TCP, with TLS if it is configured."""
