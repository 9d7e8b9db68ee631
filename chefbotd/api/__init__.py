"""The JSON-RPC command socket."""
