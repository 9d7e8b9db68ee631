"""Programs on the socket that talk to people and to each other."""
