"""Tests of the third system."""
