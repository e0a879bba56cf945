"""The kinds of curves, one file each: the equations that single their motions out."""
