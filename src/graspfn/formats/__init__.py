"""Mesh files of every format that is read: one mesh from the bytes of one file, or the reason why not."""
