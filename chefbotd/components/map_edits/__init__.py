"""What people change on a stored map by hand: kept as operations in metres, beside the map's own files."""
