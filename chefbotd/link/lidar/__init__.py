"""Lidars: a serial link for each, from its bytes to whole turns. Only a robot that has one loads this."""
