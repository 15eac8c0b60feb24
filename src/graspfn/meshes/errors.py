"""What can be wrong with a mesh."""


class MeshError(ValueError):
    """A folder or file of meshes that cannot be used: one line that names it and says what it takes."""

    def __init__(self, message: str):
        super().__init__(printable(" ".join(message.split())))  # where a name or a reader's reason has several lines


class RejectedMeshError(MeshError):
    """A mesh that is no object to grasp, or a damaged file; the selection records the reason and draws another."""


def printable(name: str) -> str:
    r"""A name as a table or a terminal can hold it: a byte of a file's name that is no UTF-8 as \udcXX."""
    return name.encode("utf-8", "backslashreplace").decode()
