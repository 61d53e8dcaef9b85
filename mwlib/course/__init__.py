"""Tooling for the notebooks and the figures: run, execute and filter, learner copies, structure rules, index page."""
