"""Listening at the ports of this computer: the only part of the doctor that opens or reads anything."""
