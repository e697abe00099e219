"""Measure other renderers on the same scene, camera and truth."""
