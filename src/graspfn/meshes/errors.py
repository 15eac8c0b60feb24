"""What can be wrong with a mesh."""


class MeshError(ValueError):
    """A folder or file of meshes that cannot be used: one line that names it and says what it takes."""

    def __init__(self, message: str):
        super().__init__(" ".join(message.split()))  # even where a file's name or a reader's reason has several


class RejectedMeshError(MeshError):
    """A mesh that is no object to grasp, or a damaged file; the selection records the reason and draws another."""
