"""`hsplat compare`: `pairs.py`, what each may differ by (`rules.py`), the verdict (`judge.py`), and reports."""
