"""Making a map: its methods, its progress, and the growing map."""
