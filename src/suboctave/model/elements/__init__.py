"""Elements, one file a family: what acts between two places, with its law, its derivatives and its smoothness."""
