"""Keeps the goldens of scenes, and compares, replaces and accepts them."""
