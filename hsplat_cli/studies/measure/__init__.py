"""Measure the accuracy and the cost of settings on one scene (`hsplat measure`)."""
