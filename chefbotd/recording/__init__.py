"""Records bytes and events to MCAP files and reads them, with the ring of the last minutes.

Everything here is synchronous, and knows no event loop: ``writer.WriterThread`` runs it where it can wait for a disk.
"""
