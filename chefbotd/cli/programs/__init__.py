"""What both programs start with: their commands, arguments and configuration."""
