"""The page in the browser: its files, and a WebSocket with the methods of the command socket."""
