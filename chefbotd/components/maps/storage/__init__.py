"""Maps on the disk: files in a folder, written whole or not at all, in versions.

Nothing here knows the loop, and nothing but `contents` loads numpy.
"""
