"""Keep golden frames of a scene, and the file that records their origin (`hsplat golden`)."""
