"""What lasts: labelled datasets of computed curves."""
