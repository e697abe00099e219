"""`hsplat golden`: frames that a scene is to go on giving, and the file that says where they come from."""
