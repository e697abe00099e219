"""What a study is written to: a table for the terminal, CSV, JSON and a page; and the frame of other such pages."""
