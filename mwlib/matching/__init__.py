"""Evaluators and critics: what judges whether a motion does what a sentence says."""
