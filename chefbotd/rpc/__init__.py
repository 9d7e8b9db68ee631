"""JSON-RPC 2.0: requests, results, topics, roles and leases. It knows no socket."""
