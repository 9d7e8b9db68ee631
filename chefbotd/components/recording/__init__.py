"""Records bytes and events to MCAP files and reads them, with the ring of the last minutes.

The files are written without an event loop: ``writer.WriterThread`` runs where it can wait for a disk.
"""
