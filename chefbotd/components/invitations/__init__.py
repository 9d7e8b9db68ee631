"""Lets a phone in: invitations by a QR code, a link or a short code, and the access that each gives."""
