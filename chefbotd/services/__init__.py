"""The only loops: await an event, call a pure step, publish."""
