"""What can be wrong with a mesh."""


class MeshError(ValueError):
    """A folder or file of meshes that cannot be used: one line that names it and says what it takes."""


class RejectedMeshError(MeshError):
    """A readable mesh that is no object to grasp; the selection records the reason and draws another."""
