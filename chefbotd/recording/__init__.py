"""Bytes and events to disk and back: MCAP files, and the ring of the last minutes.

Everything here is synchronous, and knows no event loop: ``writer.WriterThread`` runs it where it can wait for a disk.
"""
