"""Furnished buildings that come with the simulator: tables of walls and furniture, and the map files drawn from them."""
