"""What several commands share: arguments, exit codes, output, the connection."""
