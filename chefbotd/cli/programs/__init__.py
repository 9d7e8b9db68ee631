"""The entry points of both programs: commands, arguments and configuration."""
