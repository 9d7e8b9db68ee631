"""What decides on invitations; time and chance are arguments."""
