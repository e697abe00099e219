"""Other renderers, put on the same scene, camera and truth as hsplat."""
