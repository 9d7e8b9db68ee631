"""The serial link: opening it, keeping it, and turning its bytes into events."""
