"""Experiments made of the engine: one file each, runnable, each a test."""
