"""Published motions, brought from their publishers: downloads, checks, and the lists of the clips behind our tables."""
