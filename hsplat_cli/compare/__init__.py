"""`hsplat compare`: pairs of frames (`pairs.py`), what each may differ by (`rules.py`), the verdict (`judge.py`), reports."""
