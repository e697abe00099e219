"""Assemble one film from frames that several jobs drew."""
