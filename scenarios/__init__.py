"""Numerical experiments: each is one file that can be run, and a test."""
