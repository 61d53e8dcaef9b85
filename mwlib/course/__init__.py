"""Tooling for the notebooks and the figures: run, execute and filter, learner copies, index page."""
