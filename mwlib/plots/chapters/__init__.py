"""Pictures that one chapter draws, a module a subject."""
