"""Making a map: its methods, how far it is, and the map as it grows."""
