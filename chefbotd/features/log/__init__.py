"""The log's last lines on the socket."""
