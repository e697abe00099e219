"""`hsplat assemble`: one film of frames that several jobs have drawn."""
