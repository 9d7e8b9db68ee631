"""chefbotd as a systemd service: installed and removed, step by step, each of which is told."""
