"""The serial link: opens it, keeps it open, and turns its bytes into events."""
