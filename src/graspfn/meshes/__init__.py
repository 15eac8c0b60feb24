"""Objects as the other stages find them: meshes and manifest on disk, mass, where each was placed."""
